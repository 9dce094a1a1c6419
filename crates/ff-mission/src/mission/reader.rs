//! A TOML table read key by key: every wrong key, type and number is recorded with its place, none stops.
//!
//! A derived `serde` reader stops at the first mistake and knows the place of only some; this one asks for
//! each key by name, so the keys asked for are the keys known, and [`Table::finish`] reports the rest.

use ff_model::diagnostics::{LineIndex, clip};
pub(crate) use ff_model::keys::error;
use ff_model::keys::{missing_key, not_finite, unit_of, unknown_key, wrong_type};
use ff_model::{Problem, Problems};
use std::cell::RefCell;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Positions and findings of one file.
#[derive(Debug)]
pub(super) struct Context<'t> {
    lines: LineIndex<'t>,
    problems: RefCell<Problems>,
}

impl<'t> Context<'t> {
    pub(super) fn new(text: &'t str) -> Self {
        Self { lines: LineIndex::new(text), problems: RefCell::default() }
    }
    /// Records a problem as it is.
    pub(super) fn push(&self, p: Problem) {
        self.problems.borrow_mut().push(p);
    }
    /// Records a problem at a place of the file.
    pub(super) fn push_at(&self, span: Range<usize>, p: Problem) {
        let (line, column) = self.lines.at(span.start);
        self.push(p.at(line, column));
    }
    /// Everything found so far, which is then forgotten.
    pub(super) fn take(&self) -> Problems {
        self.problems.take()
    }
    /// Reports every NaN and infinity of the file: the one door they must not pass.
    pub(super) fn finite(&self, path: &str, v: &Spanned<DeValue<'_>>) {
        match v.get_ref() {
            DeValue::Float(f) if !f.as_str().parse::<f64>().is_ok_and(f64::is_finite) => {
                self.push_at(v.span(), not_finite(f.as_str(), path).on(path));
            }
            DeValue::Array(a) => a.iter().enumerate().for_each(|(i, x)| self.finite(&format!("{path}[{i}]"), x)),
            DeValue::Table(t) => t.iter().for_each(|(k, x)| self.finite(&join(path, k.get_ref()), x)),
            _ => {}
        }
    }
}

fn join(path: &str, key: &str) -> String {
    if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") }
}

/// What a number must be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Must {
    /// Anything finite.
    Any,
    /// Above zero.
    BePositive,
    /// Zero or more.
    NotBeNegative,
}

/// One table, the keys asked for so far, and where it stands.
#[derive(Debug)]
pub(super) struct Table<'d, 't> {
    cx: &'d Context<'t>,
    table: &'d DeTable<'t>,
    span: Range<usize>,
    path: String,
    asked: RefCell<Vec<&'static str>>,
}

impl<'d, 't> Table<'d, 't> {
    /// The whole file.
    pub(super) fn root(cx: &'d Context<'t>, table: &'d Spanned<DeTable<'t>>) -> Self {
        Self { cx, table: table.get_ref(), span: 0..0, path: String::new(), asked: RefCell::default() }
    }
    fn sub(&self, v: &'d Spanned<DeValue<'t>>, path: String) -> Option<Self> {
        match v.get_ref() {
            DeValue::Table(t) => Some(Self { cx: self.cx, table: t, span: v.span(), path, asked: RefCell::default() }),
            other => {
                self.mismatch(v.span(), &path, other, "a table");
                None
            }
        }
    }
    fn get(&self, key: &'static str) -> Option<&'d Spanned<DeValue<'t>>> {
        self.asked.borrow_mut().push(key);
        self.table.get(key)
    }
    fn mismatch(&self, span: Range<usize>, path: &str, found: &DeValue<'_>, wanted: &str) {
        self.cx.push_at(span, wrong_type(found.type_str(), wanted).on(path));
    }

    /// Full name of a key.
    pub(super) fn name_of(&self, key: &str) -> String {
        join(&self.path, key)
    }
    /// Records a problem at a key, or at the table if the key is absent.
    pub(super) fn fail(&self, key: &str, p: Problem) {
        let span = self.table.get(key).map_or(self.span.clone(), Spanned::span);
        let p = if p.object.is_none() { p.on(self.name_of(key)) } else { p };
        self.cx.push_at(span, p);
    }
    /// The value, or a `MissingKey` problem at the table.
    pub(super) fn required<V>(&self, key: &'static str, value: Option<V>) -> Option<V> {
        // Present but wrong has been reported as such.
        if value.is_none() && !self.table.contains_key(key) {
            let p = missing_key(key).hint(format!("add {key} = ..."));
            let object = if self.path.is_empty() { "file".to_owned() } else { self.path.clone() };
            self.cx.push_at(self.span.clone(), p.on(object));
        }
        value
    }
    /// Reports every key that was not asked for.
    pub(super) fn finish(&self) {
        let known = self.asked.borrow();
        for (k, _) in self.table.iter().filter(|(k, _)| !known.contains(&k.get_ref().as_ref())) {
            let p = unknown_key(k.get_ref(), &known);
            self.cx.push_at(k.span(), p.on(if self.path.is_empty() { "file" } else { &self.path }));
        }
    }

    /// A sub-table.
    pub(super) fn table(&self, key: &'static str) -> Option<Self> {
        self.get(key).and_then(|v| self.sub(v, self.name_of(key)))
    }
    /// An array of tables; empty when absent.
    pub(super) fn tables(&self, key: &'static str) -> Vec<Self> {
        let Some(v) = self.get(key) else { return Vec::new() };
        match v.get_ref() {
            DeValue::Array(a) => {
                a.iter().enumerate().filter_map(|(i, x)| self.sub(x, format!("{}[{i}]", self.name_of(key)))).collect()
            }
            other => {
                let wanted = format!("an array of tables, [[{}]]", self.name_of(key));
                self.mismatch(v.span(), &self.name_of(key), other, &wanted);
                Vec::new()
            }
        }
    }
    /// A text.
    pub(super) fn string(&self, key: &'static str) -> Option<String> {
        self.text_of(&self.name_of(key), self.get(key)?)
    }
    /// An array of texts.
    pub(super) fn strings(&self, key: &'static str) -> Option<Vec<String>> {
        self.each(key, "an array of texts", |path, v| self.text_of(path, v))
    }
    /// A number, in range.
    pub(super) fn number(&self, key: &'static str, must: Must) -> Option<f64> {
        let v = self.get(key)?;
        let path = self.name_of(key);
        let x = self.number_of(&path, v)?;
        self.in_range(v.span(), &path, x, must)
    }
    /// An array of numbers.
    pub(super) fn numbers(&self, key: &'static str) -> Option<Vec<f64>> {
        self.each(key, "an array of numbers", |path, v| self.number_of(path, v))
    }
    /// Exactly `N` numbers.
    pub(super) fn vector<const N: usize>(&self, key: &'static str) -> Option<[f64; N]> {
        let v = self.numbers(key)?;
        let n = v.len();
        <[f64; N]>::try_from(v).ok().or_else(|| {
            self.fail(
                key,
                error("Config::WrongLength", format!("{n} numbers, expected {N}")).hint(format!("give {N} numbers")),
            );
            None
        })
    }
    /// Three rows of three numbers.
    pub(super) fn rows(&self, key: &'static str) -> Option<[[f64; 3]; 3]> {
        let rows = self.each(key, "three rows of three numbers", |path, v| match v.get_ref() {
            DeValue::Array(a) => {
                let row: Option<Vec<f64>> = a.iter().map(|x| self.number_of(path, x)).collect();
                row.and_then(|r| <[f64; 3]>::try_from(r).ok())
            }
            other => {
                self.mismatch(v.span(), path, other, "a row of three numbers");
                None
            }
        })?;
        <[[f64; 3]; 3]>::try_from(rows).ok().or_else(|| {
            self.fail(
                key,
                error("Config::WrongLength", "is not three rows of three numbers")
                    .hint("give [[.,.,.],[.,.,.],[.,.,.]]"),
            );
            None
        })
    }
    /// A whole number of zero or more.
    pub(super) fn whole(&self, key: &'static str) -> Option<u64> {
        self.whole_of(&self.name_of(key), self.get(key)?)
    }
    /// An array of whole numbers.
    pub(super) fn wholes(&self, key: &'static str) -> Option<Vec<u64>> {
        self.each(key, "an array of whole numbers", |path, v| self.whole_of(path, v))
    }
    /// True when the table has this key.
    pub(super) fn has(&self, key: &str) -> bool {
        self.table.contains_key(key)
    }
    /// Number of entries of an array, right or wrong; `None` for anything else.
    pub(super) fn entries(&self, key: &str) -> Option<usize> {
        match self.table.get(key)?.get_ref() {
            DeValue::Array(a) => Some(a.len()),
            _ => None,
        }
    }
    /// True when the value is an array of arrays.
    pub(super) fn is_nested(&self, key: &str) -> bool {
        matches!(self.table.get(key).map(Spanned::get_ref),
            Some(DeValue::Array(a)) if a.iter().any(|x| matches!(x.get_ref(), DeValue::Array(_))))
    }

    fn each<V>(
        &self,
        key: &'static str,
        wanted: &str,
        read: impl Fn(&str, &'d Spanned<DeValue<'t>>) -> Option<V>,
    ) -> Option<Vec<V>> {
        let v = self.get(key)?;
        let path = self.name_of(key);
        match v.get_ref() {
            DeValue::Array(a) => {
                let all: Vec<_> = a.iter().enumerate().map(|(i, x)| read(&format!("{path}[{i}]"), x)).collect();
                all.into_iter().collect()
            }
            other => {
                self.mismatch(v.span(), &path, other, wanted);
                None
            }
        }
    }
    fn text_of(&self, path: &str, v: &Spanned<DeValue<'_>>) -> Option<String> {
        let s = v.get_ref().as_str().map(str::to_owned);
        if s.is_none() {
            self.mismatch(v.span(), path, v.get_ref(), "a text in quotes");
        }
        s
    }
    fn number_of(&self, path: &str, v: &Spanned<DeValue<'_>>) -> Option<f64> {
        match v.get_ref() {
            // Not finite: reported for the whole file by `Context::finite`.
            DeValue::Float(f) => f.as_str().parse().ok().filter(|x: &f64| x.is_finite()),
            DeValue::Integer(i) => {
                let x = i64::from_str_radix(i.as_str(), i.radix()).ok();
                if x.is_none() {
                    self.too_large(v.span(), path, i.as_str());
                }
                x.map(|x| x as f64)
            }
            other => {
                self.mismatch(v.span(), path, other, "a number");
                None
            }
        }
    }
    fn whole_of(&self, path: &str, v: &Spanned<DeValue<'_>>) -> Option<u64> {
        match v.get_ref() {
            DeValue::Integer(i) => {
                let x = u64::from_str_radix(i.as_str(), i.radix()).ok();
                if x.is_none() {
                    self.too_large(v.span(), path, i.as_str());
                }
                x
            }
            other => {
                self.mismatch(v.span(), path, other, "a whole number");
                None
            }
        }
    }
    fn too_large(&self, span: Range<usize>, path: &str, text: &str) {
        let p = error("Config::OutOfRange", format!("{} does not fit a 64-bit whole number", clip(text))).on(path);
        self.cx.push_at(span, p.hint("give a smaller whole number, or write it with a decimal point"));
    }
    fn in_range(&self, span: Range<usize>, path: &str, x: f64, must: Must) -> Option<f64> {
        let (good, limit) = match must {
            Must::Any => (true, ""),
            Must::BePositive => (x > 0.0, "> 0"),
            Must::NotBeNegative => (x >= 0.0, ">= 0"),
        };
        if !good {
            let unit = unit_of(path);
            let p = error("Config::OutOfRange", format!("value {x}{unit}, limit {limit}{unit}")).on(path);
            self.cx.push_at(span, p.hint("give a value within the limit"));
        }
        good.then_some(x)
    }

    /// The table without some keys, as plain TOML.
    pub(super) fn rest(&self, without: &[&str]) -> toml::Table {
        let kept = self.table.iter().filter(|(k, _)| !without.contains(&k.get_ref().as_ref()));
        kept.map(|(k, v)| (k.get_ref().to_string(), plain(v.get_ref()))).collect()
    }
    /// Place of a path such as `segments[1].mass_kg` inside this table: as far as it can be followed.
    pub(super) fn place(&self, path: &str) -> Range<usize> {
        let mut span = self.span.clone();
        let mut parts = path.split(['.', '[', ']']).filter(|s| !s.is_empty());
        let mut at = parts.next().and_then(|k| self.table.get(k));
        while let Some(v) = at {
            span = v.span();
            at = parts.next().and_then(|k| match v.get_ref() {
                DeValue::Table(t) => t.get(k),
                DeValue::Array(a) => k.parse::<usize>().ok().and_then(|i| a.get(i)),
                _ => None,
            });
        }
        span
    }
    /// Records a problem of another file, which has its place there.
    pub(super) fn fail_elsewhere(&self, p: Problem) {
        self.cx.push(p);
    }
    /// Records a problem found elsewhere at a place in this table.
    pub(super) fn fail_at(&self, span: Range<usize>, p: Problem) {
        self.cx.push_at(span, p);
    }
}

/// A parsed value without its places. Numbers that do not fit become texts, which no factory takes.
fn plain(v: &DeValue<'_>) -> toml::Value {
    match v {
        DeValue::String(s) => toml::Value::String(s.to_string()),
        DeValue::Integer(i) => i64::from_str_radix(i.as_str(), i.radix())
            .map_or_else(|_| toml::Value::String(i.as_str().to_owned()), toml::Value::Integer),
        DeValue::Float(f) => {
            f.as_str().parse().map_or_else(|_| toml::Value::String(f.as_str().to_owned()), toml::Value::Float)
        }
        DeValue::Boolean(b) => toml::Value::Boolean(*b),
        DeValue::Datetime(d) => toml::Value::Datetime(*d),
        DeValue::Array(a) => toml::Value::Array(a.iter().map(|x| plain(x.get_ref())).collect()),
        DeValue::Table(t) => {
            toml::Value::Table(t.iter().map(|(k, x)| (k.get_ref().to_string(), plain(x.get_ref()))).collect())
        }
    }
}
