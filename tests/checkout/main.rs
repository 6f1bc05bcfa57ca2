//! The contents of the checkout: its layout, its dependencies, its packages, names in its documents, and the scripts of continuous integration.

#[cfg(unix)]
mod ci;
mod dependencies;
mod documents;
mod layout;
mod packages;
