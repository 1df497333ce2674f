//! One row of the table of settings, and the check of a value against it.

use crate::error::{Error, Result};

/// A value of a setting.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// Left to the renderer.
    None,
    /// A whole number.
    Int(i64),
    /// A real number.
    Float(f64),
    /// One of the setting's choices.
    Text(String),
}

/// What a setting may be.
#[derive(Debug, Clone, Copy)]
pub enum Kind {
    /// One of `choices`; those not in `available` are known and refused.
    Choice {
        /// Every name that the API has.
        choices: &'static [&'static str],
        /// Those that work.
        available: &'static [&'static str],
    },
    /// A whole number from `min` to `max`, and one of `only` where that is not empty.
    Int {
        /// Smallest.
        min: i64,
        /// Largest.
        max: i64,
        /// The only values allowed, if any are named.
        only: &'static [i64],
    },
    /// A whole number from `min` to `max` that is a multiple of `of`.
    Multiple {
        /// Smallest.
        min: i64,
        /// Largest.
        max: i64,
        /// What divides it.
        of: i64,
    },
    /// A real number above `min` (or equal to it) up to `max`.
    Float {
        /// Lower bound.
        min: f64,
        /// Upper bound.
        max: f64,
        /// `min` itself is not allowed.
        exclusive: bool,
    },
}

/// A default, in constant form.
#[derive(Debug, Clone, Copy)]
pub enum Default {
    /// Left to the renderer.
    None,
    /// A whole number.
    Int(i64),
    /// A real number.
    Float(f64),
    /// One of the choices.
    Text(&'static str),
}

/// One row of the table.
#[derive(Debug, Clone, Copy)]
pub struct Spec {
    /// Its name in `Settings`.
    pub name: &'static str,
    /// What it may be.
    pub kind: Kind,
    /// What it is unless set.
    pub default: Default,
    /// Known, but only its default is accepted for now.
    pub pending: bool,
    /// May be none as well.
    pub nullable: bool,
    /// Unit, or empty.
    pub unit: &'static str,
    /// What it does.
    pub doc: &'static str,
    /// Where it comes from.
    pub source: &'static str,
}

impl Default {
    /// As an owned value.
    pub fn value(self) -> Value {
        match self {
            Self::None => Value::None,
            Self::Int(i) => Value::Int(i),
            Self::Float(f) => Value::Float(f),
            Self::Text(t) => Value::Text(t.to_owned()),
        }
    }
}

impl Spec {
    /// # Errors
    /// `Settings`, with the value and what is allowed.
    pub fn check(&self, value: &Value) -> Result<()> {
        let refuse =
            |allowed: String| Err(Error::Settings(format!("setting {} is {value:?}; allowed: {allowed}", self.name)));
        if *value == self.default.value() || self.nullable && *value == Value::None {
            return Ok(());
        }
        if self.pending {
            return Err(Error::Settings(format!(
                "setting {} is not available yet; leave it at its default ({:?} was given)",
                self.name, value
            )));
        }
        match (self.kind, value) {
            (Kind::Choice { available, .. }, Value::Text(text)) if available.contains(&text.as_str()) => Ok(()),
            (Kind::Choice { choices, available }, Value::Text(text)) if choices.contains(&text.as_str()) => {
                Err(Error::Settings(format!(
                    "{}={text:?} is not available yet; available: {}",
                    self.name,
                    available.join(", ")
                )))
            }
            (Kind::Choice { choices, .. }, _) => refuse(choices.join(", ")),
            (Kind::Int { min, max, only }, Value::Int(i)) if *i >= min && *i <= max => {
                if only.is_empty() || only.contains(i) { Ok(()) } else { refuse(format!("{only:?}")) }
            }
            (Kind::Int { min, max, .. }, _) => refuse(format!("whole numbers from {min} to {max}")),
            (Kind::Multiple { min, max, of }, Value::Int(i)) if *i >= min && *i <= max && i % of == 0 => Ok(()),
            (Kind::Multiple { min, max, of }, _) => refuse(format!("multiples of {of} from {min} to {max}")),
            (Kind::Float { min, max, exclusive }, Value::Float(f))
                if *f <= max && (*f > min || !exclusive && *f == min) =>
            {
                Ok(())
            }
            (Kind::Float { .. }, Value::Int(i)) => self.check(&Value::Float(*i as f64)),
            (Kind::Float { min, max, .. }, _) => refuse(format!("numbers from {min} to {max}")),
        }
    }
}
