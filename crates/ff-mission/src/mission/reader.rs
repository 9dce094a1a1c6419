//! A TOML table read key by key: every wrong key, type and number is recorded with its place, none stops.
//!
//! A derived `serde` reader stops at the first mistake and knows the place of only some; this one asks for
//! each key by name, so the keys asked for are the keys known, and [`Table::finish`] reports the rest. Type, limits and default of
//! a key are those that the section declares ([`Key`]), from which the schema is printed as well; a key that is read without
//! being declared, or as something else than declared, is an error `Internal::Undeclared` of every file.

use super::declared::{Holds, Key, Literal};
use crate::lines::LineIndex;
use ff_model::diagnostics::{Limit, clip};
pub(crate) use ff_model::keys::error;
use ff_model::keys::{missing_key, not_finite, unit_of, unknown_key, wrong_type};
use ff_model::{Problem, Problems};
use std::cell::{Cell, RefCell};
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

/// What a section reads from no table at all: its defaults.
pub(super) fn absent<V>(keys: &'static [Key], read: impl FnOnce(&Table<'_, '_>) -> V) -> V {
    let (cx, table) = (Context::new(""), Spanned::new(0..0, DeTable::new()));
    read(&Table::root(&cx, &table, keys))
}

/// One table, the keys that it may have and those asked for so far, and where it stands.
#[derive(Debug)]
pub(super) struct Table<'d, 't> {
    cx: &'d Context<'t>,
    keys: Cell<&'static [Key]>,
    table: &'d DeTable<'t>,
    span: Range<usize>,
    path: String,
    asked: RefCell<Vec<&'static str>>,
}

impl<'d, 't> Table<'d, 't> {
    /// The whole file.
    pub(super) fn root(cx: &'d Context<'t>, table: &'d Spanned<DeTable<'t>>, keys: &'static [Key]) -> Self {
        let (keys, asked) = (Cell::new(keys), RefCell::default());
        Self { cx, keys, table: table.get_ref(), span: 0..0, path: String::new(), asked }
    }
    fn sub(&self, v: &'d Spanned<DeValue<'t>>, path: String, keys: &'static [Key]) -> Option<Self> {
        match v.get_ref() {
            DeValue::Table(table) => {
                let (keys, asked) = (Cell::new(keys), RefCell::default());
                Some(Self { cx: self.cx, keys, table, span: v.span(), path, asked })
            }
            other => {
                self.mismatch(v.span(), &path, other, "a table");
                None
            }
        }
    }
    /// The table turns out to be this one of several.
    pub(crate) fn is_of(&self, keys: &'static [Key]) {
        self.keys.set(keys);
    }
    /// A key as it is declared; `fits` says whether it can be read in the way that it is asked for.
    fn declared(&self, key: &'static str, fits: impl Fn(Holds) -> bool) -> Option<&'static Key> {
        self.asked.borrow_mut().push(key);
        let found = self.keys.get().iter().find(|k| k.name == key).filter(|k| fits(k.holds));
        if found.is_none() {
            let p = error("Internal::Undeclared", "is read, but not declared as what it is read as");
            self.fail(key, p.hint("please report this"));
        }
        found
    }
    /// The value of a key, with its declaration; `None` when it is absent, which is reported if it must be there.
    fn get(&self, key: &'static str, fits: impl Fn(Holds) -> bool) -> Option<(&'static Key, &'d Spanned<DeValue<'t>>)> {
        let k = self.declared(key, fits)?;
        let v = self.table.get(key);
        if k.required && v.is_none() {
            self.missing(key);
        }
        Some((k, v?))
    }
    /// What stands for a key that is absent.
    fn default(&self, key: &str) -> Option<Literal> {
        let declared = self.keys.get().iter().find(|k| k.name == key);
        declared.filter(|_| !self.has(key)).and_then(|k| k.default)
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
    /// The value, or a `MissingKey` problem at the table: for a key that some tables can do without and this one cannot.
    pub(super) fn required<V>(&self, key: &'static str, value: Option<V>) -> Option<V> {
        // Present but wrong has been reported as such, and so has a key that no table can do without.
        let told = self.keys.get().iter().any(|k| k.name == key && k.required);
        if value.is_none() && !told && !self.table.contains_key(key) {
            self.missing(key);
        }
        value
    }
    fn missing(&self, key: &str) {
        let p = missing_key(key).hint(format!("add {key} = ..."));
        let object = if self.path.is_empty() { "file".to_owned() } else { self.path.clone() };
        self.cx.push_at(self.span.clone(), p.on(object));
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
        let (k, v) = self.get(key, |h| matches!(h, Holds::Table(_) | Holds::Named))?;
        self.sub(v, self.name_of(key), keys_of(k.holds))
    }
    /// An array of tables; empty when absent. Of several kinds of table the first is supposed, see [`Table::is_of`].
    pub(super) fn tables(&self, key: &'static str) -> Vec<Self> {
        let tables = |h| matches!(h, Holds::Tables(_) | Holds::TablesOf(_) | Holds::Appendages(_));
        let Some((k, v)) = self.get(key, tables) else { return Vec::new() };
        match v.get_ref() {
            DeValue::Array(a) => {
                let path = |i| format!("{}[{i}]", self.name_of(key));
                a.iter().enumerate().filter_map(|(i, x)| self.sub(x, path(i), keys_of(k.holds))).collect()
            }
            other => {
                let wanted = format!("an array of tables, [[{}]]", self.name_of(key));
                self.mismatch(v.span(), &self.name_of(key), other, &wanted);
                Vec::new()
            }
        }
    }
    /// A text or word, its default when absent.
    pub(super) fn string(&self, key: &'static str) -> Option<String> {
        match self.get(key, |h| matches!(h, Holds::Text | Holds::OneOf(_))) {
            Some((_, v)) => self.text_of(&self.name_of(key), v),
            None => match self.default(key)? {
                Literal::Word(w) => Some(w.to_owned()),
                _ => None,
            },
        }
    }
    /// An array of texts.
    pub(super) fn strings(&self, key: &'static str) -> Option<Vec<String>> {
        self.each(key, |h| h == Holds::Texts, "an array of texts", |path, v| self.text_of(path, v))
    }
    /// A number within its limits, its default when absent.
    pub(super) fn number(&self, key: &'static str) -> Option<f64> {
        let Some((k, v)) = self.get(key, |h| limits(h).is_some()) else {
            return match self.default(key)? {
                Literal::Number(x) => Some(x),
                _ => None,
            };
        };
        let path = self.name_of(key);
        let x = self.number_of(&path, v)?;
        self.in_range(v.span(), &path, x, limits(k.holds)?)
    }
    /// An array of numbers.
    pub(super) fn numbers(&self, key: &'static str) -> Option<Vec<f64>> {
        self.all_numbers(key, |h| h == Holds::Numbers)
    }
    fn all_numbers(&self, key: &'static str, fits: impl Fn(Holds) -> bool) -> Option<Vec<f64>> {
        self.each(key, fits, "an array of numbers", |path, v| self.number_of(path, v))
    }
    /// Exactly `N` numbers.
    pub(super) fn vector<const N: usize>(&self, key: &'static str) -> Option<[f64; N]> {
        let fits = |h| h == Holds::Vector(N) || (N == 6 && h == Holds::Symmetric);
        let v = self.all_numbers(key, fits)?;
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
        let fits = |h| matches!(h, Holds::Rows | Holds::Symmetric);
        let rows = self.each(key, fits, "three rows of three numbers", |path, v| match v.get_ref() {
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
    /// A whole number within its limits, its default when absent.
    pub(super) fn whole(&self, key: &'static str) -> Option<u64> {
        let Some((k, v)) = self.get(key, |h| matches!(h, Holds::Whole | Holds::WholeWithin { .. })) else {
            return match self.default(key)? {
                Literal::Whole(x) => Some(x),
                _ => None,
            };
        };
        let x = self.whole_of(&self.name_of(key), v)?;
        match k.holds {
            Holds::WholeWithin { from, to, unit } if !(from..=to).contains(&x) => {
                let what = format!("value {x}{unit}, limit {from} to {to}{unit}");
                let limit = Limit::Within(from as f64, to as f64);
                let p = error("Config::OutOfRange", what).violating(x as f64, limit, unit.trim_start());
                self.fail(key, p.hint("give a whole number within the limits"));
                None
            }
            _ => Some(x),
        }
    }
    /// True or false.
    pub(super) fn flag(&self, key: &'static str) -> Option<bool> {
        let (_, v) = self.get(key, |h| h == Holds::Flag)?;
        match v.get_ref() {
            DeValue::Boolean(b) => Some(*b),
            other => {
                self.mismatch(v.span(), &self.name_of(key), other, "true or false");
                None
            }
        }
    }
    /// The whole number of a key, if it is above `limit`; reports nothing.
    pub(super) fn newer_than(&self, key: &str, limit: u64) -> Option<u64> {
        match self.table.get(key)?.get_ref() {
            DeValue::Integer(i) => u64::from_str_radix(i.as_str(), i.radix()).ok().filter(|x| *x > limit),
            _ => None,
        }
    }
    /// An array of whole numbers.
    pub(super) fn wholes(&self, key: &'static str) -> Option<Vec<u64>> {
        self.each(key, |h| h == Holds::Wholes, "an array of whole numbers", |path, v| self.whole_of(path, v))
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
        fits: impl Fn(Holds) -> bool,
        wanted: &str,
        read: impl Fn(&str, &'d Spanned<DeValue<'t>>) -> Option<V>,
    ) -> Option<Vec<V>> {
        let (_, v) = self.get(key, fits)?;
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
    fn in_range(&self, span: Range<usize>, path: &str, x: f64, limits: &[Bound]) -> Option<f64> {
        let broken = limits.iter().find(|b| !b.limit.admits(x));
        if let Some(Bound { limit, text, hint }) = broken {
            let unit = unit_of(path);
            let text = text.map_or_else(|| limit.to_string(), str::to_owned);
            let p = error("Config::OutOfRange", format!("value {x}{unit}, limit {text}{unit}"));
            self.cx.push_at(span, p.violating(x, *limit, unit.trim_start()).on(path).hint(*hint));
        }
        broken.is_none().then_some(x)
    }

    /// The table without the keys that are declared, as plain TOML.
    pub(crate) fn undeclared(&self) -> toml::Table {
        let declared = |name: &str| self.keys.get().iter().any(|k| k.name == name);
        let kept = self.table.iter().filter(|(k, _)| !declared(k.get_ref()));
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

/// One side of what a number may be.
struct Bound {
    limit: Limit,
    /// The limit as messages write it, where its number says less.
    text: Option<&'static str>,
    hint: &'static str,
}

impl Bound {
    const fn new(limit: Limit, hint: &'static str) -> Self {
        Self { limit, text: None, hint }
    }
}

/// The limits of a key that holds a number; `None` for any other.
fn limits(holds: Holds) -> Option<&'static [Bound]> {
    const WITHIN: &str = "give a value within the limit";
    const POSITIVE: Bound = Bound::new(Limit::Above(0.0), WITHIN);
    const NOT_NEGATIVE: Bound = Bound::new(Limit::AtLeast(0.0), WITHIN);
    const BELOW_PI: Bound = Bound {
        limit: Limit::Below(std::f64::consts::PI),
        text: Some("< pi"),
        hint: "give the angle in radians; leave it out for no limit",
    };
    const BELOW_ONE: Bound = Bound::new(Limit::Below(1.0), "give a fraction, such as 0.1 for 10 %");
    const OFFSET: Bound = Bound::new(Limit::Above(-1.0), "a start value must keep the sign of the nominal one");
    match holds {
        Holds::Number => Some(&[]),
        Holds::Positive => Some(&[POSITIVE]),
        Holds::NotNegative => Some(&[NOT_NEGATIVE]),
        Holds::Angle => Some(&[POSITIVE, BELOW_PI]),
        Holds::Fraction => Some(&[NOT_NEGATIVE, BELOW_ONE]),
        Holds::Offset => Some(&[OFFSET]),
        _ => None,
    }
}

/// The keys of a table, or of each in an array.
fn keys_of(holds: Holds) -> &'static [Key] {
    match holds {
        Holds::Table(keys) | Holds::Tables(keys) | Holds::Appendages(keys) => keys,
        Holds::TablesOf(tables) => tables.first().copied().unwrap_or_default(),
        _ => &[],
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
