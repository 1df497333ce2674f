//! The one closed error type of the crate.

/// What can go wrong; each variant is one exception class in Python.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// The scene, a mesh, a light or a camera is not usable; the text names the argument and its value.
    #[error("{0}")]
    Scene(String),
    /// A setting is unknown or out of range.
    #[error("{0}")]
    Settings(String),
    /// The adapter is missing, lost, out of memory or too small for the work.
    #[error("{0}")]
    Device(String),
    /// A shader does not compile or was bound wrongly: a fault of ours, never of the user's.
    #[error("{0}")]
    Shader(String),
    /// The caller's cancel check asked to stop.
    #[error("the render was cancelled")]
    Cancelled,
}

/// Result with [`enum@Error`].
pub type Result<T> = std::result::Result<T, Error>;
