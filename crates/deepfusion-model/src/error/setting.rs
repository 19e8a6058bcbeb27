//! Why a text is no configuration, or a key of one cannot be set.

/// What the parser of TOML says of a text or a table, without the line break that ends it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}", .0.to_string().trim_end())]
pub struct TomlProblem(pub Box<toml::de::Error>);

impl From<toml::de::Error> for TomlProblem {
    fn from(error: toml::de::Error) -> Self {
        Self(Box::new(error))
    }
}

/// Why a key cannot be set so.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SettingProblem {
    /// There is no `=`.
    #[error("expected KEY=VALUE")]
    NoValue,
    /// A key under one that is no table.
    #[error("`{key}` is a value and no table")]
    NoTable {
        /// What is no table.
        key: String,
    },
    /// Nothing has this name.
    #[error("there is no key `{key}`")]
    NoSuchKey {
        /// The name.
        key: String,
    },
    /// The key is unknown, or cannot have this value: what the parser says.
    #[error("{}", .0.to_string().trim().replace('\n', " "))]
    Value(Box<toml::de::Error>),
    /// Something else decides it; what, in its caller's words.
    #[error("{0}")]
    DecidedElsewhere(&'static str),
}
