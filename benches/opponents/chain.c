/* Opponents of the benchmark: the detection chain of the manual with the word lengths of its default
 * written as constants, by hand. `serial` runs sample by sample; `block` makes the moments of a block of R
 * samples by weighted sums. Both take 16-bit codes from memory and put rows into memory.
 *
 *   program serial|block TUNING_WORD SAMPLES RUNS
 *
 * prints the seconds of the fastest run and the checksum of rate, phase and magnitude.
 * PROD_SHIFT, if defined, is how many bits the product drops (nearest, ties up). */
#include <stdint.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#define T_CODE int16_t
#define R 64
typedef struct { int32_t atan[16]; int32_t k; int16_t table[1024]; } tabs;
static inline int64_t hu(int64_t v,int s){ return (v + ((int64_t)1<<(s-1)))>>s; }
static inline void slow(const tabs*t,const int64_t S[4], int64_t *row){
  int32_t ch[4];
  for(int k=0;k<4;k++) ch[k]=(int32_t)hu(S[k],25); /* Q2.30 *2^-18 -> Q9.23 */
  int32_t x=(int32_t)((uint32_t)ch[0]<<6), y=(int32_t)((uint32_t)ch[1]<<6), z=0;
  if(x<0){ int32_t ox=x; if(y>=0){x=y;y=(int32_t)(0u-(uint32_t)ox);z=1<<30;} else {x=(int32_t)(0u-(uint32_t)y);y=ox;z=-(1<<30);} }
  for(int i=0;i<16;i++){
    int32_t dx=y>>i, dy=x>>i, a=t->atan[i];
    int32_t m = y>>31; /* negative: -1 */
    x=(int32_t)((uint32_t)x+(uint32_t)((dx^m)-m)); y=(int32_t)((uint32_t)y-(uint32_t)((dy^m)-m)); z=(int32_t)((uint32_t)z+(uint32_t)((a^m)-m));
  }
  int64_t mag=((int64_t)x*t->k + (1ll<<21))>>22;
  int64_t p=z;
  int64_t v=4483318;
  v=7961641+hu(v*p,31); v=3591373+hu(v*p,31);
  int64_t bias=hu(v,7);
  /* sense I in deg/s = ch * 2^-23 * 2^15 -> 8 fraction bits: no shift: ch<<0 */
  int64_t q=ch[2];
  int64_t lim=(1<<23)-1;
  if(bias>lim)bias=lim; if(bias<-lim-1)bias=-lim-1;
  int64_t r=q-bias; if(r>lim)r=lim; if(r<-lim-1)r=-lim-1;
  row[0]=ch[0];row[1]=ch[1];row[2]=ch[2];row[3]=ch[3];row[4]=z;row[5]=mag;row[6]=r;
}
#ifdef PROD_SHIFT
#define CASTP(v) hu((v),PROD_SHIFT)
#else
#define CASTP(v) (v)
#define PROD_SHIFT 0
#endif
/* Integrators, combs and phase between two calls. */
typedef struct { uint64_t I[4][3], D[4][3]; uint32_t ph; } state;
#define LOAD uint64_t I[4][3], D[4][3]; uint32_t ph=kept->ph; memcpy(I,kept->I,sizeof I); memcpy(D,kept->D,sizeof D)
#define KEEP memcpy(kept->I,I,sizeof I); memcpy(kept->D,D,sizeof D); kept->ph=ph
void serial(const tabs*t,state*kept,const T_CODE*d,const T_CODE*s,long n,uint32_t step,int64_t*rows){
  LOAD;
  for(long b=0;b+R<=n;b+=R){
    for(int i=0;i<R;i++){
      ph+=step; uint32_t a=ph>>22; int64_t si=t->table[a], co=t->table[(a+256)&1023];
      int64_t p[4]={CASTP(d[b+i]*si),CASTP(d[b+i]*co),CASTP(s[b+i]*si),CASTP(s[b+i]*co)};
      for(int k=0;k<4;k++){ I[k][0]+=p[k]; I[k][1]+=I[k][0]; I[k][2]+=I[k][1]; }
    }
    int64_t S[4];
    for(int k=0;k<4;k++){ uint64_t v=I[k][2]; for(int j=0;j<3;j++){uint64_t w=v-D[k][j]; D[k][j]=v; v=w;} S[k]=(int64_t)(v<<PROD_SHIFT); }
    slow(t,S,rows); rows+=7;
  }
  KEEP;
}
void block(const tabs*t,state*kept,const T_CODE*d,const T_CODE*s,long n,uint32_t step,int64_t*rows){
  LOAD;
  int32_t w2[R],w3[R]; for(int i=0;i<R;i++){w2[i]=R-i; w3[i]=(R-i)*(R-i+1)/2;}
  for(long b=0;b+R<=n;b+=R){
    int32_t si[R],co[R];
    for(int i=0;i<R;i++){ uint32_t a=(ph+(uint32_t)(i+1)*step)>>22; si[i]=t->table[a]; co[i]=t->table[(a+256)&1023]; }
    ph+=R*step;
    int64_t S[4];
    for(int k=0;k<4;k++){
      const T_CODE*in=(k<2?d:s)+b; const int32_t*c=k&1?co:si;
      int64_t m1=0,m2=0,m3=0;
      for(int i=0;i<R;i++){ int64_t p=CASTP((int64_t)in[i]*c[i]); m1+=p; m2+=p*w2[i]; m3+=p*w3[i]; }
      I[k][2]+= R*I[k][1] + (uint64_t)(R*(R+1)/2)*I[k][0] + (uint64_t)m3;
      I[k][1]+= R*I[k][0]+(uint64_t)m2; I[k][0]+=(uint64_t)m1;
      uint64_t v=I[k][2]; for(int j=0;j<3;j++){uint64_t w=v-D[k][j]; D[k][j]=v; v=w;} S[k]=(int64_t)(v<<PROD_SHIFT);
    }
    slow(t,S,rows); rows+=7;
  }
  KEEP;
}

static double now(void){ struct timespec t; clock_gettime(CLOCK_MONOTONIC,&t); return (double)t.tv_sec+1e-9*(double)t.tv_nsec; }
static int saturated(int v){ return v>32767?32767:v<-32768?-32768:v; }
/* The capture of the manual's golden values. */
typedef struct { uint32_t x,ph,m; } signals;
static void codes(const tabs*t,signals*g,T_CODE*d,T_CODE*s,long n){
  uint32_t x=g->x,ph=g->ph,m=g->m;
  for(long i=0;i<n;i++){ ph+=33555666; m+=77777; int si=t->table[ph>>22],co=t->table[((ph>>22)+256)&1023],mm=t->table[m>>22];
    x=x*1664525+1013904223; int n1=(int)(x>>24)-128; x=x*1664525+1013904223; int n2=(int)(x>>24)-128;
    d[i]=(int16_t)saturated(((26000*si)>>15)+n1); s[i]=(int16_t)saturated((((((mm*3000)>>15)+9000)*co)>>15)+((2000*si)>>15)+n2); }
  *g=(signals){x,ph,m};
}
static tabs tables(void){
  tabs t; for(int i=0;i<1024;i++) t.table[i]=(int16_t)lrint(32767*sin(2*M_PI*i/1024));
  double g=1; for(int i=0;i<16;i++){ t.atan[i]=(int32_t)llrint(atan(ldexp(1,-i))/(2*M_PI)*4294967296.0); g*=sqrt(1+ldexp(1,-2*i)); }
  t.k=(int32_t)lrint(65536/g);
  return t;
}
#ifndef WITHOUT_MAIN
int main(int argc,char**argv){
  if(argc<5) return 2;
  tabs t=tables();
  uint32_t word=(uint32_t)strtoul(argv[2],0,10); long n=atol(argv[3]); int runs=atoi(argv[4]);
  int16_t*d=malloc(2*(size_t)n),*s=malloc(2*(size_t)n); int64_t*rows=malloc(8*7*(size_t)(n/R)+8); memset(rows,1,8*7*(size_t)(n/R));
  signals g={0x12345678,0,0}; codes(&t,&g,d,s,n);
  double best=1e9;
  for(int r=0;r<runs;r++){ double a=now(); state kept={0}; (argv[1][0]=='s'?serial:block)(&t,&kept,d,s,n,word,rows); double b=now()-a; if(b<best) best=b; }
  uint64_t h=0xcbf29ce484222325ull;
  for(long i=0;i<n/R;i++){ int64_t w[3]={rows[7*i+6],rows[7*i+4],rows[7*i+5]}; for(int j=0;j<3;j++) h=(h^(uint32_t)w[j])*0x100000001b3ull; }
  printf("%.9f %016llx\n",best,(unsigned long long)h);
  return 0;
}
#endif
