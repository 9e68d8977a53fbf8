/* Opponent of `gyrogen replay` from NPY to NPY: the same file work around the chain of chain.c.
 *
 *   program make SAMPLES FILE                     writes the capture of the manual's golden values
 *   program serial|block TUNING_WORD IN OUT       replays it, block after block
 *
 * The rows go into a file beside OUT that takes its name at the end. */
#define WITHOUT_MAIN
#include "chain.c"
#include <fcntl.h>
#include <unistd.h>
#include <sys/stat.h>
#define BLOCK 65536
static int all(int file,const void*from,size_t bytes){
  const char*p=from; while(bytes){ ssize_t k=write(file,p,bytes); if(k<=0) return 1; p+=k; bytes-=(size_t)k; } return 0;
}
/* A header of version 1.0: padded with blanks to 128 bytes, so that the shape can be written at the end. */
static void header(char*to,const char*descr,long rows,int columns){
  memset(to,' ',128); memcpy(to,"\x93NUMPY\x01\x00\x76\x00",10);
  int k=sprintf(to+10,"{'descr': '%s', 'fortran_order': False, 'shape': (%ld, %d), }",descr,rows,columns);
  to[10+k]=' '; to[127]='\n';
}
static int make(const char*path,long samples){
  tabs t=tables(); signals g={0x12345678,0,0}; char h[128]; header(h,"<i2",samples,2);
  static int16_t d[BLOCK],s[BLOCK],both[2*BLOCK];
  int file=open(path,O_WRONLY|O_CREAT|O_TRUNC,0644); if(file<0||all(file,h,128)) return 1;
  for(long left=samples;left>0;left-=BLOCK){
    long n=left<BLOCK?left:BLOCK; codes(&t,&g,d,s,n);
    for(long i=0;i<n;i++){ both[2*i]=d[i]; both[2*i+1]=s[i]; }
    if(all(file,both,4*(size_t)n)) return 1;
  }
  return close(file);
}
int main(int argc,char**argv){
  if(argc==4&&argv[1][0]=='m') return make(argv[3],atol(argv[2]));
  if(argc!=5) return 2;
  tabs t=tables(); state kept={0}; uint32_t word=(uint32_t)strtoul(argv[2],0,10);
  int in=open(argv[3],O_RDONLY); char h[128],name[4096]; if(in<0||read(in,h,128)!=128) return 1;
  long samples=atol(strstr(h+10,"'shape': (")+10);
  snprintf(name,sizeof name,"%s.part",argv[4]);
  int out=open(name,O_WRONLY|O_CREAT|O_TRUNC,0644); long index=0;
  header(h,"<i8",0,8); if(out<0||all(out,h,128)) return 1;
  static int16_t both[2*BLOCK],d[BLOCK],s[BLOCK]; static int64_t rows[7*BLOCK/R],with[8*BLOCK/R];
  for(long left=samples;left>0;left-=BLOCK){
    long n=left<BLOCK?left:BLOCK; size_t got=0;
    while(got<4*(size_t)n){ ssize_t k=read(in,(char*)both+got,4*(size_t)n-got); if(k<=0) return 1; got+=(size_t)k; }
    for(long i=0;i<n;i++){ d[i]=both[2*i]; s[i]=both[2*i+1]; }
    (argv[1][0]=='s'?serial:block)(&t,&kept,d,s,n,word,rows);
    for(long i=0;i<n/R;i++){ with[8*i]=index++; memcpy(with+8*i+1,rows+7*i,56); }
    if(all(out,with,64*(size_t)(n/R))) return 1;
  }
  header(h,"<i8",index,8); if(pwrite(out,h,128,0)!=128||close(out)) return 1;
  return rename(name,argv[4]);
}
