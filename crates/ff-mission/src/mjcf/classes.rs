//! `<default>`: values of attributes by class, which an element takes where it is silent.

use roxmltree::Node;
use std::collections::HashMap;

/// Attributes by element and name, per class.
#[derive(Debug, Default)]
pub(super) struct Classes<'a> {
    of: HashMap<&'a str, HashMap<(&'a str, &'a str), &'a str>>,
}

/// Most classes of a file.
const MAX_CLASSES: usize = 1000;

/// The class of what has none.
const MAIN: &str = "main";

impl<'a> Classes<'a> {
    /// All `<default>` of a file: a class takes what its outer class gives.
    pub(super) fn read(root: Node<'a, '_>) -> Self {
        let mut out = Self::default();
        for d in root.children().filter(|n| n.has_tag_name("default")) {
            out.class(d, MAIN);
        }
        out
    }
    fn class(&mut self, n: Node<'a, '_>, outer: &'a str) {
        if self.too_many() {
            return;
        }
        let name = n.attribute("class").unwrap_or(MAIN);
        let mut values = self.of.get(outer).cloned().unwrap_or_default();
        let own = self.of.get(name).cloned().unwrap_or_default();
        values.extend(own);
        for e in n.children().filter(|c| c.is_element() && !c.has_tag_name("default")) {
            values.extend(e.attributes().map(|a| ((e.tag_name().name(), a.name()), a.value())));
        }
        self.of.insert(name, values);
        for inner in n.children().filter(|c| c.has_tag_name("default")) {
            self.class(inner, name);
        }
    }
    /// True when there are more classes than any model has: each holds what its outer class gives.
    pub(super) fn too_many(&self) -> bool {
        self.of.len() > MAX_CLASSES
    }
    /// True for a class that exists.
    pub(super) fn has(&self, class: &str) -> bool {
        class == MAIN || self.of.contains_key(class)
    }
    /// Names of all classes.
    pub(super) fn names(&self) -> impl Iterator<Item = &'a str> + '_ {
        self.of.keys().copied()
    }
    /// The value of an attribute: the element's own, that of its class, of the class of the bodies around it, or of all.
    pub(super) fn value(&self, n: Node<'a, '_>, around: Option<&str>, attribute: &str) -> Option<&'a str> {
        if let Some(own) = n.attribute(attribute) {
            return Some(own);
        }
        let class = n.attribute("class").or(around).unwrap_or(MAIN);
        self.of.get(class)?.get(&(n.tag_name().name(), attribute)).copied()
    }
}
