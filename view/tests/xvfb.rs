//! A real window on a virtual screen: Xvfb. Without Xvfb this test prints `skipped: why` and passes; with `CURITIBA_REQUIRE_XVFB_TESTS=1` it
//! fails instead.

use std::path::Path;
use std::process::Command;

#[test]
fn a_real_window_opens_shows_the_picture_and_closes() {
    let there = Command::new("xvfb-run").arg("--help").output().is_ok();
    if !there {
        let required = std::env::var_os("CURITIBA_REQUIRE_XVFB_TESTS").is_some_and(|value| value == "1");
        assert!(!required, "xvfb-run is not there: apt-get install xvfb xauth");
        println!("skipped: xvfb-run is not there");
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("window.png");
    let project = Path::new(env!("CARGO_MANIFEST_DIR")).join("../xml_projects/SceneShadows.xml");
    let screen = ["-a", "-s", "-screen 0 1280x800x24"];
    let mut command = Command::new("xvfb-run");
    command
        .args(screen)
        .arg(env!("CARGO_BIN_EXE_curitiba-view"))
        .arg(project)
        .args(["--size", "256x256", "--raster", "cpu"]);
    command.args(["--backend", "cpu", "--quit-after", "30", "--window-png"]).arg(&file);
    // The window opens on X11, even if Wayland is available.
    let output = command.env_remove("WAYLAND_DISPLAY").output().expect("it starts");
    let printed = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{printed}");
    let picture = curitiba::pipeline::image::read_image(&file).expect("the window was written").image;
    let colors: std::collections::HashSet<_> = picture.pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect();
    assert!(
        picture.width >= 760 && colors.len() > 500,
        "{} x {}, {} colours",
        picture.width,
        picture.height,
        colors.len()
    );
    if let Some(pictures) = std::env::var_os("CURITIBA_PICTURES") {
        std::fs::copy(&file, Path::new(&pictures).join("window-xvfb.png")).expect("copied");
    }
}
