//! Who imports whom: the paths of a crate's sources, resolved to the files that define what they name.

use proc_macro2::{TokenStream, TokenTree};
use std::collections::{BTreeMap, BTreeSet};
use syn::spanned::Spanned;
use syn::visit::{self, Visit};

/// An import: a `use`, or a path written out.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Import {
    /// Path of the importing file below `src`.
    pub from: String,
    /// 1-based.
    pub line: usize,
    /// As it is meant, without `crate`.
    pub path: String,
    /// Path of the file that defines what is named.
    pub to: String,
}

/// What one module holds.
#[derive(Default)]
struct Module {
    file: String,
    items: BTreeSet<String>,
    /// Name here, and the path that it stands for.
    names: BTreeMap<String, Vec<String>>,
    globs: Vec<Vec<String>>,
    /// Path, line, whether it is handed on with `pub use`.
    paths: Vec<(Vec<String>, usize, bool)>,
}

/// The imports of sources, given as (path below `src`, text); tests are left out.
pub fn imports(sources: &[(String, String)]) -> Vec<Import> {
    let parsed: Vec<(String, Vec<String>, syn::File)> = sources
        .iter()
        .map(|(path, text)| {
            let file = syn::parse_file(text).unwrap_or_else(|e| panic!("{path}: {e}"));
            (path.clone(), module_of(path), file)
        })
        .collect();
    let tests: BTreeSet<Vec<String>> = parsed
        .iter()
        .flat_map(|(_, module, file)| declared_for_tests(module, &file.items))
        .collect();
    let is_test = |module: &[String]| (1..=module.len()).any(|n| tests.contains(&module[..n]));
    let files: BTreeSet<Vec<String>> = parsed.iter().map(|(_, m, _)| m.clone()).collect();
    let mut modules: BTreeMap<Vec<String>, Module> = BTreeMap::new();
    for (path, module, file) in &parsed {
        if is_test(module) || path.ends_with("_tests.rs") || path.ends_with("/tests.rs") {
            continue;
        }
        let mut reading = Reading {
            files: &files,
            at: module.clone(),
            module: Module {
                file: path.clone(),
                ..Module::default()
            },
        };
        reading.visit_file(file);
        modules.insert(module.clone(), reading.module);
    }
    let mut found = Vec::new();
    for (module, held) in &modules {
        for (path, line, handed_on) in &held.paths {
            let Some(to) = resolved(&modules, path, 0) else {
                continue;
            };
            let own_child = to.starts_with(module) && *handed_on;
            let to = &modules[&to].file;
            if *to != held.file && !own_child {
                found.push(Import {
                    from: held.file.clone(),
                    line: *line,
                    path: path.join("::"),
                    to: to.clone(),
                });
            }
        }
    }
    found.sort();
    found.dedup();
    found
}

/// The module that defines what an absolute path names, through re-exports.
fn resolved(
    modules: &BTreeMap<Vec<String>, Module>,
    path: &[String],
    depth: usize,
) -> Option<Vec<String>> {
    let known = (1..=path.len())
        .rev()
        .find(|n| modules.contains_key(&path[..*n]))?;
    let (at, rest) = path.split_at(known);
    let module = &modules[at];
    let Some((name, rest)) = rest.split_first() else {
        return Some(at.to_vec());
    };
    if depth < 8 && !module.items.contains(name) {
        let on = |target: &[String]| [target, rest].concat();
        if let Some(target) = module.names.get(name) {
            return resolved(modules, &on(target), depth + 1).or(Some(at.to_vec()));
        }
        for glob in &module.globs {
            let target = [glob.as_slice(), std::slice::from_ref(name)].concat();
            let to = resolved(modules, &on(&target), depth + 1);
            if let Some(to) = to.filter(|to| modules[to].items.contains(name)) {
                return Some(to);
            }
        }
    }
    Some(at.to_vec())
}

fn module_of(path: &str) -> Vec<String> {
    let stem = path.trim_end_matches(".rs").trim_end_matches("/mod");
    stem.split('/').map(str::to_owned).collect()
}

fn is_for_tests(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|a| {
        let syn::Meta::List(list) = &a.meta else {
            return false;
        };
        let words: Vec<String> = list
            .tokens
            .clone()
            .into_iter()
            .map(|t| t.to_string())
            .collect();
        a.path().is_ident("cfg") && words.first().is_some_and(|w| w == "test")
    })
}

fn declared_for_tests(module: &[String], items: &[syn::Item]) -> Vec<Vec<String>> {
    let of = |item: &syn::Item| match item {
        syn::Item::Mod(m) if is_for_tests(&m.attrs) => {
            Some([module, &[m.ident.to_string()]].concat())
        }
        _ => None,
    };
    items.iter().filter_map(of).collect()
}

struct Reading<'a> {
    files: &'a BTreeSet<Vec<String>>,
    at: Vec<String>,
    module: Module,
}

impl Reading<'_> {
    /// The absolute path, if it is one of this crate.
    fn absolute(&self, path: &[String]) -> Option<Vec<String>> {
        let mut base = self.at.clone();
        let mut rest = path;
        match path.first()?.as_str() {
            "crate" => return Some(path[1..].to_vec()),
            "self" | "super" => {
                while let Some(first) = rest.first() {
                    match first.as_str() {
                        "self" => (),
                        "super" => _ = base.pop(),
                        _ => break,
                    }
                    rest = &rest[1..];
                }
            }
            child => {
                let below = [base.as_slice(), &[child.to_owned()]].concat();
                self.files.contains(&below).then_some(())?;
            }
        }
        Some([base.as_slice(), rest].concat())
    }

    fn note(&mut self, path: &[String], line: usize, handed_on: bool) -> Option<Vec<String>> {
        let path = self.absolute(path)?;
        self.module.paths.push((path.clone(), line, handed_on));
        Some(path)
    }

    fn tree(&mut self, tree: &syn::UseTree, before: &[String], handed_on: bool) {
        let line = tree.span().start().line;
        let with = |name: &syn::Ident| [before, &[name.to_string()]].concat();
        match tree {
            syn::UseTree::Path(p) => self.tree(&p.tree, &with(&p.ident), handed_on),
            syn::UseTree::Group(g) => {
                for tree in &g.items {
                    self.tree(tree, before, handed_on);
                }
            }
            syn::UseTree::Name(n) => self.named(&with(&n.ident), None, line, handed_on),
            syn::UseTree::Rename(r) => {
                self.named(&with(&r.ident), Some(r.rename.to_string()), line, handed_on);
            }
            syn::UseTree::Glob(_) => {
                if let Some(path) = self.note(before, line, handed_on) {
                    self.module.globs.push(path);
                }
            }
        }
    }

    fn named(&mut self, path: &[String], renamed: Option<String>, line: usize, handed_on: bool) {
        let path = match path.split_last() {
            Some((last, path)) if last == "self" => path,
            _ => path,
        };
        let Some(absolute) = self.note(path, line, handed_on) else {
            return;
        };
        let name = renamed.or_else(|| path.last().cloned());
        if let Some(name) = name {
            self.module.names.insert(name, absolute);
        }
    }

    /// Paths inside a macro's words, which nobody has parsed.
    fn words(&mut self, tokens: TokenStream) {
        let mut path: Vec<String> = Vec::new();
        let (mut colons, mut line) = (0, 0);
        let end = |path: &mut Vec<String>, line: usize, this: &mut Self| {
            if path.len() > 1 {
                this.note(path, line, false);
            }
            path.clear();
        };
        for token in tokens {
            match token {
                TokenTree::Ident(word) => {
                    if colons != 2 {
                        end(&mut path, line, self);
                    }
                    line = word.span().start().line;
                    path.push(word.to_string());
                    colons = 0;
                }
                TokenTree::Punct(p) if p.as_char() == ':' => colons += 1,
                TokenTree::Group(group) => {
                    end(&mut path, line, self);
                    self.words(group.stream());
                    colons = 0;
                }
                _ => {
                    end(&mut path, line, self);
                    colons = 0;
                }
            }
        }
        end(&mut path, line, self);
    }
}

impl<'ast> Visit<'ast> for Reading<'_> {
    fn visit_item(&mut self, item: &'ast syn::Item) {
        let name = match item {
            syn::Item::Const(i) => Some((&i.ident, &i.attrs)),
            syn::Item::Enum(i) => Some((&i.ident, &i.attrs)),
            syn::Item::Fn(i) => Some((&i.sig.ident, &i.attrs)),
            syn::Item::Mod(i) => Some((&i.ident, &i.attrs)),
            syn::Item::Static(i) => Some((&i.ident, &i.attrs)),
            syn::Item::Struct(i) => Some((&i.ident, &i.attrs)),
            syn::Item::Trait(i) => Some((&i.ident, &i.attrs)),
            syn::Item::Type(i) => Some((&i.ident, &i.attrs)),
            _ => None,
        };
        let attributes: &[syn::Attribute] = match item {
            syn::Item::Impl(i) => &i.attrs,
            syn::Item::Use(i) => &i.attrs,
            _ => name.map_or(&[][..], |(_, attributes)| attributes),
        };
        if is_for_tests(attributes) {
            return;
        }
        if let (Some((name, _)), false) = (name, matches!(item, syn::Item::Mod(_))) {
            self.module.items.insert(name.to_string());
        }
        visit::visit_item(self, item);
    }

    fn visit_item_mod(&mut self, item: &'ast syn::ItemMod) {
        self.at.push(item.ident.to_string());
        visit::visit_item_mod(self, item);
        self.at.pop();
    }

    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        let handed_on = !matches!(item.vis, syn::Visibility::Inherited);
        self.tree(&item.tree, &[], handed_on);
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        let words: Vec<String> = path.segments.iter().map(|s| s.ident.to_string()).collect();
        if words.len() > 1 {
            self.note(&words, path.span().start().line, false);
        }
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, m: &'ast syn::Macro) {
        self.words(m.tokens.clone());
        visit::visit_macro(self, m);
    }
}
