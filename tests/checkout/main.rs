//! What the checkout holds: its layout, its dependencies, its packages, and the scripts of continuous integration.

#[cfg(unix)]
mod ci;
mod dependencies;
mod layout;
mod packages;
