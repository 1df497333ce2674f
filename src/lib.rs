//! miplight
