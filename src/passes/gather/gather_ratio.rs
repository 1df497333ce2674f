//! The exact unshadowed irradiance of an area light times its visible share.

use super::gather::{Gathered, record_as};
use crate::error::Result;
use crate::passes::Context;

/// Adds the irradiance of one area light at each receiver.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub fn record(context: &mut Context<'_, '_>, work: &Gathered<'_>) -> Result<()> {
    record_as(context, "gather_ratio", work)
}
