//! The table of an appendage in a mission file, read key by key: every problem is recorded, none stops.
//!
//! A factory asks for each key by name and type. What was asked for is what is known: [`read`] reports the
//! rest with the nearest known key. The unit in messages is the one the key name ends with. Objects of
//! problems are paths such as `segments[1].hinge_axis[2]`, which the mission loader turns into line and
//! column.
//!
//! ```
//! use crate::keys;
//!
//! let tether = |table: &toml::Table| {
//!     keys::read(table, |k| {
//!         let (mass, axis) = (k.number("mass_kg"), k.numbers::<3>("axis"));
//!         let rest = k.number_or("rest_m", 0.0);
//!         Some((mass?, axis?, rest?))
//!     })
//! };
//! let good = "mass_kg = 2\naxis = [0.0, 0.6, 0.8]".parse().unwrap();
//! assert_eq!(tether(&good).unwrap(), (2.0, [0.0, 0.6, 0.8], 0.0));
//! let bad = "mas_kg = 2\naxis = [0.0, nan, 0.8]".parse().unwrap();
//! let problems = tether(&bad).unwrap_err();
//! assert_eq!(problems.0.len(), 3);
//! assert!(problems.to_string().contains("did you mean mass_kg?"));
//! ```

use crate::diagnostics::problem::{Area, Problem, Problems};
use crate::diagnostics::text::{clip, list, nearest};
use nalgebra::Matrix3;
use std::ops::RangeInclusive;

/// Reads a table: runs `f` over its keys, then reports every key `f` did not ask for. Allocates.
///
/// `f` should ask for all its keys before it gives up (`let a = k.number("a"); let b = k.number("b");
/// Some((a?, b?))`), so that one run shows everything that is wrong.
///
/// # Errors
/// Every problem found: `Config::MissingKey`, `Config::Type`, `Config::NotFinite`, `Config::UnknownKey`, and
/// what `f` recorded through [`Keys::problems`].
pub fn read<V>(table: &toml::Table, f: impl FnOnce(&mut Keys<'_, '_>) -> Option<V>) -> Result<V, Problems> {
    let mut problems = Problems::default();
    let value = read_into(table, String::new(), &mut problems, f);
    problems.finish(value).map(|(v, _)| v)
}

fn read_into<V>(
    table: &toml::Table,
    path: String,
    problems: &mut Problems,
    f: impl FnOnce(&mut Keys<'_, '_>) -> Option<V>,
) -> Option<V> {
    let mut keys = Keys { table, path, asked: Vec::new(), judged: true, problems };
    let value = f(&mut keys);
    keys.report_unknown();
    value
}

/// One table of an appendage, and the keys asked for so far. Handed out by [`read`] and [`Keys::each`].
///
/// A getter gives `None` when its key is missing or wrong; the problem is then recorded.
#[derive(Debug)]
pub struct Keys<'t, 'p> {
    table: &'t toml::Table,
    /// Where the table stands, with a dot at its end unless empty.
    path: String,
    asked: Vec<&'static str>,
    /// Whether keys that nobody asks for are reported.
    judged: bool,
    problems: &'p mut Problems,
}

impl<'t> Keys<'t, '_> {
    /// A finite number; whole numbers count.
    pub fn number(&mut self, key: &'static str) -> Option<f64> {
        let wanted = format!("a number{}", unit_in_brackets(key));
        let (path, value) = self.required(key, &wanted)?;
        self.finite(path, value, &wanted)
    }
    /// A finite number, `default` when the key is absent.
    pub fn number_or(&mut self, key: &'static str, default: f64) -> Option<f64> {
        if self.table.contains_key(key) {
            return self.number(key);
        }
        self.asked.push(key);
        Some(default)
    }
    /// A number within limits, both inclusive.
    pub fn number_within(&mut self, key: &'static str, limits: RangeInclusive<f64>) -> Option<f64> {
        let x = self.number(key)?;
        if limits.contains(&x) {
            return Some(x);
        }
        let (unit, lo, hi) = (unit_of(key), limits.start(), limits.end());
        let what = format!("{x:?}{unit} is outside {lo:?}{unit} to {hi:?}{unit}");
        let problem = error("Config::Param", what).hint(format!("give a number within these limits{}", in_units(unit)));
        self.problems.push(problem.on(format!("{}{key}", self.path)));
        None
    }
    /// Exactly `N` finite numbers.
    pub fn numbers<const N: usize>(&mut self, key: &'static str) -> Option<[f64; N]> {
        self.array(key, &format!("{} numbers{}", count(N), unit_in_brackets(key)))
    }
    /// A symmetric matrix as six finite numbers xx, xy, xz, yy, yz, zz.
    pub fn symmetric(&mut self, key: &'static str) -> Option<Matrix3<f64>> {
        let six = self.array(key, &format!("six numbers xx, xy, xz, yy, yz, zz{}", unit_in_brackets(key)))?;
        Some(symmetric(&six))
    }
    /// An array of tables, `f` reading each by its place in the array; `what` says what a table stands for.
    ///
    /// `None` unless all could be read. Every table is read, even when one before it is wrong.
    pub fn each<V>(
        &mut self,
        key: &'static str,
        what: &str,
        mut f: impl FnMut(usize, &mut Keys<'_, '_>) -> Option<V>,
    ) -> Option<Vec<V>> {
        let (path, value) = self.required(key, what)?;
        let Some(rows) = value.as_array() else {
            self.problems.push(wrong_type(value.type_str(), "an array of tables").on(path));
            return None;
        };
        let mut all = Vec::with_capacity(rows.len());
        for (i, row) in rows.iter().enumerate() {
            let at = format!("{path}[{i}]");
            all.push(match row.as_table() {
                Some(table) => read_into(table, at + ".", self.problems, |k| f(i, k)),
                None => {
                    self.problems.push(wrong_type(row.type_str(), "a table").on(at));
                    None
                }
            });
        }
        all.into_iter().collect()
    }
    /// True when the table has this key; whoever asks knows the key.
    pub fn has(&mut self, key: &'static str) -> bool {
        self.asked.push(key);
        self.table.contains_key(key)
    }
    /// Leaves keys that nobody asks for unreported: for a table whose sort cannot be told, so that none can be judged.
    pub fn accept_unknown(&mut self) {
        self.judged = false;
    }
    /// Full path of a key of this table, for problems of the caller's own.
    pub fn path_of(&self, key: &str) -> String {
        format!("{}{key}", self.path)
    }
    /// A text.
    pub fn text(&mut self, key: &'static str) -> Option<&'t str> {
        let (path, value) = self.required(key, "a text in quotes")?;
        if value.as_str().is_none() {
            self.problems.push(wrong_type(value.type_str(), "a text in quotes").on(path));
        }
        value.as_str()
    }
    /// One of a few words; `default` when the key is absent and there is one.
    pub fn choice(
        &mut self,
        key: &'static str,
        known: &[&'static str],
        default: Option<&'static str>,
    ) -> Option<&'t str> {
        if let (false, Some(d)) = (self.has(key), default) {
            return Some(d);
        }
        let word = self.text(key)?;
        if known.contains(&word) {
            return Some(word);
        }
        let p = error("Config::BadChoice", format!("'{}' is none of {}", clip(word), list(known.iter().copied(), 20)));
        let p = p.on(self.path_of(key));
        self.problems.push(match nearest(word, known.iter().copied()) {
            Some(n) => p.hint(format!("did you mean {n}?")),
            None => p.hint("use one of them"),
        });
        None
    }
    /// An array of finite numbers, as many as there are.
    pub fn list(&mut self, key: &'static str) -> Option<Vec<f64>> {
        let wanted = format!("an array of numbers{}", unit_in_brackets(key));
        let (path, value) = self.required(key, &wanted)?;
        self.list_of(&path, value, &wanted)
    }
    /// A matrix as an array of rows, as many of each as there are; rows may differ in length.
    pub fn matrix(&mut self, key: &'static str) -> Option<Vec<Vec<f64>>> {
        let wanted = format!("an array of rows of numbers{}", unit_in_brackets(key));
        let (path, value) = self.required(key, &wanted)?;
        let Some(rows) = value.as_array() else {
            self.problems.push(wrong_type(value.type_str(), &wanted).on(path));
            return None;
        };
        let all: Vec<_> =
            (0..).zip(rows).map(|(i, r)| self.list_of(&format!("{path}[{i}]"), r, "a row of numbers")).collect();
        all.into_iter().collect()
    }
    /// A table inside the table, read by `f`; `what` says what it stands for.
    pub fn table<V>(
        &mut self,
        key: &'static str,
        what: &str,
        f: impl FnOnce(&mut Keys<'_, '_>) -> Option<V>,
    ) -> Option<V> {
        let (path, value) = self.required(key, what)?;
        match value.as_table() {
            Some(table) => read_into(table, path + ".", self.problems, f),
            None => {
                self.problems.push(wrong_type(value.type_str(), "a table").on(path));
                None
            }
        }
    }
    /// The problems found so far, to add what only the appendage can judge. Their objects are full paths.
    pub fn problems(&mut self) -> &mut Problems {
        self.problems
    }

    /// Path and value of a key that must be there.
    fn required(&mut self, key: &'static str, wanted: &str) -> Option<(String, &'t toml::Value)> {
        self.asked.push(key);
        let path = format!("{}{key}", self.path);
        let value = self.table.get(key);
        if value.is_none() {
            self.problems.push(missing_key(key).on(&path).hint(format!("add {wanted}")));
        }
        value.map(|v| (path, v))
    }
    fn array<const N: usize>(&mut self, key: &'static str, wanted: &str) -> Option<[f64; N]> {
        let (path, value) = self.required(key, wanted)?;
        let Some(all) = value.as_array().filter(|a| a.len() == N) else {
            let found = value.as_array().map_or(value.type_str().to_owned(), |a| format!("array of {}", a.len()));
            self.problems.push(wrong_type(&found, wanted).on(path));
            return None;
        };
        let mut out = [0.0; N];
        let mut good = true;
        for (i, (x, v)) in out.iter_mut().zip(all).enumerate() {
            match self.finite(format!("{path}[{i}]"), v, "a number") {
                Some(n) => *x = n,
                None => good = false,
            }
        }
        good.then_some(out)
    }
    fn list_of(&mut self, path: &str, value: &toml::Value, wanted: &str) -> Option<Vec<f64>> {
        let Some(all) = value.as_array() else {
            self.problems.push(wrong_type(value.type_str(), wanted).on(path));
            return None;
        };
        let all: Vec<_> = (0..).zip(all).map(|(i, v)| self.finite(format!("{path}[{i}]"), v, "a number")).collect();
        all.into_iter().collect()
    }
    fn finite(&mut self, path: String, value: &toml::Value, wanted: &str) -> Option<f64> {
        let problem = match value {
            toml::Value::Float(x) if x.is_finite() => return Some(*x),
            toml::Value::Integer(i) => return Some(*i as f64),
            toml::Value::Float(x) => not_finite(&x.to_string(), &path),
            other => wrong_type(other.type_str(), wanted),
        };
        self.problems.push(problem.on(path));
        None
    }
    fn report_unknown(&mut self) {
        if !self.judged {
            return;
        }
        for key in self.table.keys().filter(|k| !self.asked.contains(&k.as_str())) {
            self.problems.push(unknown_key(key, &self.asked).on(format!("{}{key}", self.path)));
        }
    }
}

/// The symmetric matrix of xx, xy, xz, yy, yz, zz: the order of every inertia in a mission file.
pub(crate) fn symmetric(&[xx, xy, xz, yy, yz, zz]: &[f64; 6]) -> Matrix3<f64> {
    Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
}

/// Why this stiffness at this key cannot be that of a passive spring (M35), if so.
pub fn check_stiffness(path: &str, value: f64) -> Option<Problem> {
    not_negative(path, value, "it would push away from rest")
}

/// Why this damping at this key cannot be that of a passive damper (M35), if so.
pub fn check_damping(path: &str, value: f64) -> Option<Problem> {
    not_negative(path, value, "it would feed energy into the motion")
}

fn not_negative(path: &str, value: f64, law: &str) -> Option<Problem> {
    let unit = unit_of(path);
    let problem = if !value.is_finite() {
        not_finite(&value.to_string(), path)
    } else if value < 0.0 {
        error("Config::NotPassive", format!("{value}{unit} is below the limit 0{unit}: {law}"))
            .hint("give the magnitude; the restoring sign is built in")
    } else {
        return None;
    };
    Some(problem.on(path))
}

/// A configuration error.
pub(crate) fn error(code: &'static str, message: impl Into<String>) -> Problem {
    Problem::error(Area::Config, code, message)
}

/// A required key that is not there.
pub(crate) fn missing_key(key: &str) -> Problem {
    error("Config::MissingKey", format!("required key '{key}' is missing"))
}

/// A value of a wrong type.
pub(crate) fn wrong_type(found: &str, wanted: &str) -> Problem {
    error("Config::Type", format!("is {found}, expected {wanted}")).hint(format!("give {wanted}"))
}

/// A number that is NaN or infinite, as written or printed; `path` tells its unit.
pub(crate) fn not_finite(value: &str, path: &str) -> Problem {
    let what = format!("{}{} is not a finite number", clip(value), unit_of(path));
    error("Config::NotFinite", what).hint("give a finite number")
}

/// A key nobody asks for.
pub(crate) fn unknown_key(key: &str, known: &[&'static str]) -> Problem {
    let p = error("Config::UnknownKey", format!("unknown key '{}'", clip(key)));
    match nearest(key, known.iter().copied()) {
        Some(n) => p.hint(format!("did you mean {n}?")),
        None => p.hint(format!("known here: {}", list(known.iter().copied(), 20))),
    }
}

/// The unit a key name ends with, after a blank: `panel.stiffness_nm_per_rad[0]` is in ` N m/rad`.
pub(crate) fn unit_of(path: &str) -> &'static str {
    // Longer endings first: `_rad` is an ending of `_nm_per_rad`, too.
    const UNITS: [(&str, &str); 18] = [
        ("_kg_per_m3", " kg/m^3"),
        ("_ns_per_m", " N s/m"),
        ("_n_per_m", " N/m"),
        ("_nms_per_rad", " N m s/rad"),
        ("_nm_per_rad", " N m/rad"),
        ("_rad_per_s2", " rad/s^2"),
        ("_rad_per_s", " rad/s"),
        ("_m_per_s2", " m/s^2"),
        ("_m3_per_s2", " m^3/s^2"),
        ("_kgm2", " kg m^2"),
        ("_bits", " bits"),
        ("_rad", " rad"),
        ("_nm", " N m"),
        ("_kg", " kg"),
        ("_hz", " Hz"),
        ("_m", " m"),
        ("_s", " s"),
        ("_n", " N"),
    ];
    let key = path.rsplit('.').next().unwrap_or(path);
    let key = key.split('[').next().unwrap_or(key);
    UNITS.iter().find(|(suffix, _)| key.ends_with(suffix)).map_or("", |(_, u)| u)
}

fn unit_in_brackets(key: &str) -> String {
    match unit_of(key).trim_start() {
        "" => String::new(),
        unit => format!(" ({unit})"),
    }
}

/// `, in kg`, where there is a unit.
fn in_units(unit: &str) -> String {
    if unit.is_empty() { String::new() } else { format!(", in{unit}") }
}

/// A small count in words, as prose has it.
fn count(n: usize) -> String {
    const WORDS: [&str; 7] = ["no", "one", "two", "three", "four", "five", "six"];
    WORDS.get(n).map_or_else(|| n.to_string(), |w| (*w).to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn objects(p: &Problems) -> Vec<(&str, &str)> {
        p.0.iter().map(|p| (p.code, p.object.as_deref().unwrap_or(""))).collect()
    }

    #[test]
    fn reads_every_type_and_asks_for_nothing_twice() {
        let t =
            "a_kg = 3\nb_m = [0.5, -2]\nj_kgm2 = [1.5, 0.1, 0.2, 2.5, 0.3, 3.5]\nrow = [{ x_s = 0.7 }, { x_s = 0.8 }]"
                .parse()
                .unwrap();
        let all = read(&t, |k| {
            let (a, b, c) = (k.number("a_kg"), k.numbers::<2>("b_m"), k.number_or("c_rad", 0.4));
            let (j, rows) = (k.symmetric("j_kgm2"), k.each("row", "rows", |i, k| Some((i, k.number("x_s")?))));
            Some((a?, b?, c?, j?, rows?))
        });
        let j = Matrix3::new(1.5, 0.1, 0.2, 0.1, 2.5, 0.3, 0.2, 0.3, 3.5);
        assert_eq!(all.unwrap(), (3.0, [0.5, -2.0], 0.4, j, vec![(0, 0.7), (1, 0.8)]));
    }

    #[test]
    fn every_problem_is_recorded_with_its_path() {
        let t = "a_kg = '3'\nb_m = [0.5]\nc_rad = inf\nrow = [{ x_s = [nan, true] }, 7, {}]\nd_hz = 2\nelse = 1"
            .parse()
            .unwrap();
        let p = read(&t, |k| {
            let _ = (k.number("a_kg"), k.numbers::<2>("b_m"), k.number_or("c_rad", 0.4), k.number("d2_hz"));
            k.each("row", "rows", |_, k| k.numbers::<2>("x_s"))
        })
        .unwrap_err();
        let want = [
            ("Config::Type", "a_kg"),
            ("Config::Type", "b_m"),
            ("Config::NotFinite", "c_rad"),
            ("Config::MissingKey", "d2_hz"),
            ("Config::NotFinite", "row[0].x_s[0]"),
            ("Config::Type", "row[0].x_s[1]"),
            ("Config::Type", "row[1]"),
            ("Config::MissingKey", "row[2].x_s"),
            ("Config::UnknownKey", "d_hz"),
            ("Config::UnknownKey", "else"),
        ];
        assert_eq!(objects(&p), want, "{p}");
        assert!(p.0.iter().all(|p| p.hint.is_some()));
        for says in ["is string, expected a number (kg)", "inf rad", "is array of 1, expected two numbers (m)"] {
            assert!(p.to_string().contains(says), "{says}: {p}");
        }
        assert!(p.to_string().contains("did you mean d2_hz?"), "{p}");
    }

    #[test]
    fn texts_choices_matrices_and_tables() {
        let t = "word = 'tea'\nk_n_per_m = [[1.5, 2], [3.5]]\nlist_m = [0.5, 7]\ninner = { x_s = 0.25 }\nelse = 1"
            .parse()
            .unwrap();
        let all = read(&t, |k| {
            let (a, b) = (k.choice("word", &["tea", "coffee"], None), k.choice("other", &["milk"], Some("milk")));
            let (m, l) = (k.matrix("k_n_per_m"), k.list("list_m"));
            let inner = k.table("inner", "a table", |k| k.number("x_s"));
            assert!(!k.has("absent"));
            k.accept_unknown();
            assert_eq!(k.text("word"), Some("tea"));
            Some((a?.to_owned(), b?.to_owned(), m?, l?, inner?))
        });
        let want = ("tea".to_owned(), "milk".to_owned(), vec![vec![1.5, 2.0], vec![3.5]], vec![0.5, 7.0], 0.25);
        assert_eq!(all.unwrap(), want);
        let t = "word = 'cofee'\nk_n_per_m = [[1.5, inf], 2]\nlist_m = [true]\ninner = { y = 1 }\ntext = 3"
            .parse()
            .unwrap();
        let p = read(&t, |k| {
            let _ =
                (k.choice("word", &["tea", "coffee"], None), k.matrix("k_n_per_m"), k.list("list_m"), k.text("text"));
            k.table("inner", "a table", |k| k.number("x_s"))
        })
        .unwrap_err();
        let want = [
            ("Config::BadChoice", "word"),
            ("Config::NotFinite", "k_n_per_m[0][1]"),
            ("Config::Type", "k_n_per_m[1]"),
            ("Config::Type", "list_m[0]"),
            ("Config::Type", "text"),
            ("Config::MissingKey", "inner.x_s"),
            ("Config::UnknownKey", "inner.y"),
        ];
        assert_eq!(objects(&p), want, "{p}");
        assert!(p.to_string().contains("did you mean coffee?") && p.to_string().contains("inf N/m"), "{p}");
    }

    #[test]
    fn limits_are_inclusive_and_named() {
        let t = "a_kg = 3\nb_m = 0.25\nc = 7.5\nd_kg = 1e300".parse().unwrap();
        let good = read(&t, |k| {
            let _ = (k.number("c"), k.number("d_kg"));
            Some((k.number_within("a_kg", 0.5..=3.0)?, k.number_within("b_m", 0.25..=2.0)?))
        });
        assert_eq!(good.unwrap(), (3.0, 0.25));
        let p = read(&t, |k| {
            let _ = (k.number("a_kg"), k.number("b_m"));
            let (c, d) = (k.number_within("c", 0.0..=7.0), k.number_within("d_kg", 0.5..=1e6));
            Some((c?, d?))
        })
        .unwrap_err();
        assert_eq!(objects(&p), [("Config::Param", "c"), ("Config::Param", "d_kg")], "{p}");
        assert!(p.to_string().contains("1e300 kg is outside 0.5 kg to 1000000.0 kg"), "{p}");
        assert!(p.to_string().contains("within these limits, in kg"), "{p}");
    }

    #[test]
    fn springs_and_dampers_must_take_energy() {
        assert_eq!(check_stiffness("k_nm_per_rad", 0.0), None);
        let p = check_stiffness("s[1].k_nm_per_rad", -2.0).unwrap();
        assert_eq!((p.code, p.object.as_deref()), ("Config::NotPassive", Some("s[1].k_nm_per_rad")));
        assert!(p.message.contains("-2 N m/rad is below the limit 0 N m/rad"), "{p}");
        assert_eq!(check_damping("d_nms_per_rad", f64::NAN).unwrap().code, "Config::NotFinite");
        assert!(check_damping("d_nms_per_rad", -1.0).unwrap().message.contains("energy"));
    }

    #[test]
    fn units_are_read_off_the_last_key() {
        for (path, unit) in [
            ("robot.rigid[0].mass_kg", " kg"),
            ("a.d_nms_per_rad[1]", " N m s/rad"),
            ("k_nm_per_rad", " N m/rad"),
            ("axis", ""),
        ] {
            assert_eq!(unit_of(path), unit, "{path}");
        }
    }
}
