//! The one error type of the crate; the Python border maps each kind to an exception class.

/// What can go wrong, by who can mend it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// The scene or the camera is not something that can be rendered.
    #[error("{0}")]
    Scene(String),
    /// A setting, an output or a resource name is unknown, out of range or not available.
    #[error("{0}")]
    Settings(String),
    /// The adapter is missing, was lost, or cannot hold what was asked of it.
    #[error("{0}")]
    Device(String),
    /// A shader does not compile, or a pass binds something that the shader does not declare.
    #[error("{0}")]
    Shader(String),
    /// The caller asked to stop.
    #[error("the render was cancelled")]
    Cancelled,
}

/// The crate's result.
pub type Result<T> = std::result::Result<T, Error>;
