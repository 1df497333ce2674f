//! Stub.
use super::virtual_light::{Rsm, Tree, VirtualLights};
use crate::error::{Error, Result};
use crate::passes::Context;
/// Stub.
pub fn record(_c: &mut Context<'_, '_>, _r: &Rsm, _t: &Tree) -> Result<VirtualLights> {
    Err(Error::Settings("list".to_owned()))
}
