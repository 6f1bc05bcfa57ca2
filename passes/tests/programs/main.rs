//! Programs whose rays start at the camera or pass through glass, and the projects in `xml_projects` that use them.

mod camera;
mod camera_projects;
mod glass_projects;
