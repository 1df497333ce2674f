//! Every number and choice that a user can set: stated once, here, with its range, unit and source.

mod gather_table;
mod lpv_table;
mod presets;
mod spec;
mod table;
mod virtual_table;

use std::collections::BTreeMap;

use crate::error::{Error, Result};
pub use presets::{Changes, PRESETS};
pub use spec::{Default, Kind, Spec, Value};

/// By what they are of, in the order in which they are documented.
const TABLES: [&[Spec]; 4] = [table::GENERAL, gather_table::GATHER, virtual_table::VIRTUAL, lpv_table::LPV];
const COUNT: usize =
    table::GENERAL.len() + gather_table::GATHER.len() + virtual_table::VIRTUAL.len() + lpv_table::LPV.len();

/// All settings, in the order in which they are documented.
pub const SPECS: &[Spec] = &{
    let mut all = [table::GENERAL[0]; COUNT];
    let (mut i, mut of) = (0, 0);
    while of < TABLES.len() {
        let mut row = 0;
        while row < TABLES[of].len() {
            all[i] = TABLES[of][row];
            (i, row) = (i + 1, row + 1);
        }
        of += 1;
    }
    all
};

/// Checked settings, every one of them present.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings(BTreeMap<&'static str, Value>);

impl std::default::Default for Settings {
    fn default() -> Self {
        Self(SPECS.iter().map(|s| (s.name, s.default.value())).collect())
    }
}

impl Settings {
    /// The defaults with `changes`.
    ///
    /// # Errors
    /// `Settings` for an unknown name or a value that is out of range or not available.
    pub fn new<'a>(changes: impl IntoIterator<Item = (&'a str, Value)>) -> Result<Self> {
        let mut settings = Self::default();
        for (name, value) in changes {
            let spec = SPECS
                .iter()
                .find(|s| s.name == name)
                .ok_or_else(|| Error::Settings(format!("there is no setting {name:?}")))?;
            spec.check(&value)?;
            settings.0.insert(spec.name, value);
        }
        Ok(settings)
    }

    /// All names and values.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, &Value)> {
        self.0.iter().map(|(name, value)| (*name, value))
    }

    /// A whole number that always has a value; 0 for a setting that has none.
    pub fn int(&self, name: &str) -> u32 {
        match self.0.get(name) {
            Some(Value::Int(i)) => *i as u32,
            _ => 0,
        }
    }

    /// A real number, or none.
    pub fn float(&self, name: &str) -> Option<f64> {
        match self.0.get(name) {
            Some(Value::Float(f)) => Some(*f),
            Some(Value::Int(i)) => Some(*i as f64),
            _ => None,
        }
    }

    /// Whether a choice is `text`.
    pub fn is(&self, name: &str, text: &str) -> bool {
        matches!(self.0.get(name), Some(Value::Text(t)) if t == text)
    }
}

#[cfg(test)]
mod tests;
