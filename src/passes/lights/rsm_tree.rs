//! Stub.
use super::virtual_light::{Rsm, Tree};
use crate::error::{Error, Result};
use crate::passes::Context;
/// Stub.
pub fn record(_c: &mut Context<'_, '_>, _r: &Rsm) -> Result<Tree> {
    Err(Error::Settings("tree".to_owned()))
}
