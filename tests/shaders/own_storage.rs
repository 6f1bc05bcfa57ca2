//! Storage buffers, atomic counters and images in own shaders of passes that draw scenes: counts that follow from the drawn geometry, and errors
//! with their places in the files.
//!
//! Pictures need the feature `glsl` and a Vulkan, Metal or DirectX 12 driver (a software driver will do). Without a driver, the tests print
//! `skipped`, or fail with `CURITIBA_REQUIRE_GPU_TESTS=1`.

use crate::own_shaders::{assert_near, has_driver};
use curitiba::pipeline::backend::Rect;
use curitiba::pipeline::executor::{Renderer, Silent};
use curitiba::pipeline::image::Image;
use curitiba::pipeline::plan::Settings;
use curitiba::{Choice, OpenError, RasterChoice};

/// Counts the pixels of its material, and those of all materials.
const NEAR: &str = "#version 430
layout(binding = 2, offset = 0) uniform atomic_uint own;
layout(binding = 2, offset = 8) uniform atomic_uint all;
out vec4 color;
void main() { atomicCounterIncrement(own); atomicCounterIncrement(all); color = vec4(1.0, 0.0, 0.0, 1.0); }
";

/// Does the same with the next counter, and stores its pixels in a table.
const FAR: &str = "#version 430
layout(binding = 2, offset = 4) uniform atomic_uint own;
layout(binding = 2, offset = 8) uniform atomic_uint all;
layout(std430, binding = 3) buffer Table { vec4 cells[]; };
out vec4 color;
void main() {
    atomicCounterIncrement(own);
    atomicCounterIncrement(all);
    ivec2 at = ivec2(gl_FragCoord.xy);
    cells[at.y * 64 + at.x] = vec4(gl_FragCoord.xy / 64.0, gl_FragCoord.z, 1.0);
    color = vec4(0.0, 0.0, 1.0, 1.0);
}
";

/// Shows the counters, divided by 4096 and 8192.
const SHOW: &str = "#version 430
layout(binding = 2) uniform atomic_uint near, far, all, other;
out vec4 color;
void main() {
    color = vec4(atomicCounter(near), atomicCounter(far), atomicCounter(all) * 0.5, atomicCounter(other)) / 4096.0;
}
";

/// Shows the table.
const TABLE: &str = "#version 430
layout(std430, binding = 3) readonly buffer Table { vec4 cells[]; };
out vec4 color;
void main() { ivec2 at = ivec2(gl_FragCoord.xy); color = cells[at.y * 64 + at.x]; }
";

const LIBRARY: &str = r#"<materialLib name="L">
<textures><texture name="image"><WIDTH value="64"/><HEIGHT value="64"/><INTERNAL_FORMAT value="RGBA32F"/></texture></textures>
<renderTargets><renderTarget name="t"><SIZE width="64" height="64"/><colors><color name="drawn" internalFormat="RGBA32F"/></colors></renderTarget></renderTargets>
<buffers>
<buffer name="counts"><SIZE value="16"/></buffer>
<buffer name="table"><DIM x="64" y="64" z="1"/><structure><field value="VEC4"/></structure></buffer>
</buffers>
<shaders><shader name="near" vs="scene.vert" ps="near.frag"/><shader name="far" vs="scene.vert" ps="far.frag"/><shader name="show" vs="quad.vert" ps="show.frag"/></shaders>
<materials>
<material name="near"><shader name="near"><values>VALUES</values></shader>BINDINGS</material>
<material name="far"><shader name="far"><values>VALUES</values></shader>BINDINGS</material>
<material name="show"><shader name="show"/>BINDINGS</material>
</materials></materialLib>"#;

const BINDINGS: &str = r#"<buffers>
<buffer name="counts"><TYPE value="ATOMIC_COUNTER"/><BINDING_POINT value="2"/></buffer>
<buffer name="table" fromLibrary="L"><TYPE value="SHADER_STORAGE"/><BINDING_POINT value="3"/></buffer>
</buffers><imageTextures><imageTexture UNIT="5" texture="image"/></imageTextures>"#;

const MAPS: &str = r#"<materialMaps><map fromMaterial="near" toLibrary="L" toMaterial="near"/><map fromMaterial="far" toLibrary="L" toMaterial="far"/></materialMaps>"#;

/// A square of 32 x 32 pixels in the plane z = 0, in front of one of 64 x 64 in z = -1. The first hides a quarter of the second.
const PROJECT: &str = r#"<project name="p" width="64" height="64"><assets>
<scenes><scene name="S">
<geometry name="far" type="SQUARE" material="far"><ROTATE x="1" y="0" z="0" w="90"/><TRANSLATE x="0" y="0" z="-1"/></geometry>
<geometry name="near" type="SQUARE" material="near"><ROTATE x="1" y="0" z="0" w="90"/><SCALE x="0.5" y="0.5" z="0.5"/></geometry>
</scene></scenes>
<cameras><camera name="C"><projection TYPE="ORTHO" LEFT="-1" RIGHT="1" BOTTOM="-1" TOP="1" NEAR="1" FAR="9"/>
<POSITION x="0" y="0" z="5"/><VIEW x="0" y="0" z="-1"/><UP x="0" y="1" z="0"/></camera></cameras>
<lights><light name="Sun" type="directional"><DIRECTION x="0" y="0" z="-1"/></light></lights>
<materialLibs><materialLib filename="p.mlib"/></materialLibs>
</assets><pipelines><pipeline name="p" default="true" defaultCamera="C">
PASSES
</pipeline></pipelines></project>"#;

const QUAD: &str = r#"<pass class="quad" name="show"><material name="show" fromLibrary="L"/></pass>"#;

fn draw(name: &str, inside: &str) -> String {
    let scenes = if inside.contains("<scenes") { "" } else { r#"<scenes><scene name="S"/></scenes>"# };
    format!(r#"<pass class="default" name="{name}">{scenes}<lights><light name="Sun"/></lights>{inside}</pass>"#)
}

struct Project {
    folder: tempfile::TempDir,
}

impl Project {
    /// Arguments: the passes, and the shaders of the two materials and of the quad.
    fn new(passes: &str, [near, far, show]: [&str; 3]) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let values = r#"<valueof uniform="pvm" type="RENDERER" context="CURRENT" component="PROJECTION_VIEW_MODEL"/>"#;
        let project = Self { folder };
        let scene =
            "#version 430\nuniform mat4 pvm;\nin vec4 position;\nvoid main() { gl_Position = pvm * position; }\n";
        let quad = "#version 430\nin vec4 position;\nvoid main() { gl_Position = position; }\n";
        project
            .with("p.xml", &PROJECT.replace("PASSES", passes))
            .with("p.mlib", &LIBRARY.replace("VALUES", values).replace("BINDINGS", BINDINGS))
            .with("scene.vert", scene)
            .with("quad.vert", quad)
            .with("near.frag", near)
            .with("far.frag", far)
            .with("show.frag", show)
    }

    fn with(self, name: &str, text: &str) -> Self {
        std::fs::write(self.folder.path().join(name), text).expect("written");
        self
    }

    fn open(&self, settings: Settings) -> Result<Renderer, OpenError> {
        let choice = Choice { raster: RasterChoice::Auto, ..Choice::CPU };
        curitiba::open(self.folder.path().join("p.xml"), settings, choice, &mut Silent)
    }

    /// The picture of the first frame. The second frame is the same, because a frame starts with zeros.
    fn picture(&self) -> Image {
        let mut renderer = self.open(Settings::default()).unwrap_or_else(|error| panic!("{}", error.joined()));
        let first = renderer.frame(&mut Silent).expect("it renders");
        assert_eq!(renderer.frame(&mut Silent).expect("it renders").pixels, first.pixels, "a second frame");
        first
    }

    fn refused(&self) -> String {
        self.open(Settings::default()).err().map_or_else(|| panic!("it is refused"), |error| error.joined())
    }
}

/// What the picture shows: 32 x 32 and 64 x 64 pixels of two squares, hidden or not, divided by 4096; their sum, divided by 8192; an unused counter.
const COUNTED: [f32; 4] = [0.25, 1.0, 0.625, 0.0];

#[test]
fn every_pixel_of_every_triangle_counts() {
    if !has_driver() {
        return;
    }
    let passes = format!("{}{QUAD}", draw("draw", MAPS));
    assert_near(&Project::new(&passes, [NEAR, FAR, SHOW]).picture(), |_, _| COUNTED, 0.0);
    // Pixels that a shader discards before counting do not count: the columns of the left half.
    let half = FAR.replace("void main() {", "void main() { if (gl_FragCoord.x < 32.0) discard;");
    assert_near(&Project::new(&passes, [NEAR, &half, SHOW]).picture(), |_, _| [0.25, 0.5, 0.375, 0.0], 0.0);
    // Passes add to the counts of earlier passes, and each instance counts.
    let twice = format!("{}{}{QUAD}", draw("draw", MAPS), draw("again", MAPS));
    assert_near(&Project::new(&twice, [NEAR, FAR, SHOW]).picture(), |_, _| COUNTED.map(|count| 2.0 * count), 0.0);
    let many = draw("draw", &format!(r#"<scenes instances="3"><scene name="S"/></scenes>{MAPS}"#));
    let many = Project::new(&format!("{many}{QUAD}"), [NEAR, FAR, SHOW]).picture();
    assert_near(&many, |_, _| COUNTED.map(|count| 3.0 * count), 0.0);
    // With several samples per pixel, each sample is a frame of its own.
    let settings = Settings {
        aa: curitiba::pipeline::pixel_samples::PixelSamples::new(4).expect("a power of two"),
        ..Settings::default()
    };
    let mut renderer =
        Project::new(&passes, [NEAR, FAR, SHOW]).open(settings).unwrap_or_else(|error| panic!("{}", error.joined()));
    assert_near(&renderer.frame(&mut Silent).expect("it renders"), |_, _| COUNTED, 1e-6);
}

/// The counting does not change the picture of the pass itself, whatever part of it is requested.
#[test]
fn what_is_drawn_stays_what_it_is() {
    if !has_driver() {
        return;
    }
    let project = Project::new(&draw("draw", MAPS), [NEAR, FAR, SHOW]);
    let inside = |x: u32, y: u32| (16..48).contains(&x) && (16..48).contains(&y);
    let known = |x, y| if inside(x, y) { [1.0, 0.0, 0.0, 1.0] } else { [0.0, 0.0, 1.0, 1.0] };
    let whole = project.picture();
    assert_near(&whole, known, 0.0);
    let crop = Some(Rect { x: 8, y: 16, width: 24, height: 8 });
    let mut renderer =
        project.open(Settings { crop, ..Settings::default() }).unwrap_or_else(|error| panic!("{}", error.joined()));
    let part = renderer.frame(&mut Silent).expect("it renders");
    let rows: Vec<[f32; 4]> = (16..24).flat_map(|y| whole.pixels[y * 64 + 8..][..24].to_vec()).collect();
    assert_eq!((part.width, part.height, part.pixels), (24, 8, rows));
    // Counters for a part would not equal those for the picture, so the whole picture is drawn.
    assert!(renderer.plan().needs_whole().is_some_and(|why| why.contains("`draw` draws by an own shader that stores")));
}

#[test]
fn buffers_keep_what_scenes_store() {
    if !has_driver() {
        return;
    }
    let passes = format!("{}{QUAD}", draw("draw", MAPS));
    let far = |x: u32, y: u32| [(x as f32 + 0.5) / 64.0, (63.5 - y as f32) / 64.0, 5.0 / 8.0, 1.0];
    assert_near(&Project::new(&passes, [NEAR, FAR, TABLE]).picture(), far, 1e-6);
    // A later pass reads the table through one of its two shaders with buffers; the other one counts.
    let reads = "#version 430
layout(std430, binding = 3) readonly buffer Table { vec4 cells[]; };
out vec4 color;
void main() { ivec2 at = ivec2(gl_FragCoord.xy); color = cells[at.y * 64 + at.x] * 0.5; }
";
    let library = LIBRARY.replace(
        "<material name=\"show\">",
        "<material name=\"read\"><shader name=\"read\"><values>VALUES</values></shader>BINDINGS</material>\n<material name=\"show\">",
    );
    let library = library.replace(
        "<shader name=\"show\" vs",
        "<shader name=\"read\" vs=\"scene.vert\" ps=\"read.frag\"/><shader name=\"show\" vs",
    );
    let values = r#"<valueof uniform="pvm" type="RENDERER" context="CURRENT" component="PROJECTION_VIEW_MODEL"/>"#;
    let maps = MAPS.replace(
        r#"fromMaterial="far" toLibrary="L" toMaterial="far""#,
        r#"fromMaterial="far" toLibrary="L" toMaterial="read""#,
    );
    let project = Project::new(&format!("{}{}", draw("draw", MAPS), draw("read", &maps)), [NEAR, FAR, TABLE])
        .with("p.mlib", &library.replace("VALUES", values).replace("BINDINGS", BINDINGS))
        .with("read.frag", reads);
    let inside = |x: u32, y: u32| (16..48).contains(&x) && (16..48).contains(&y);
    let known = |x, y| if inside(x, y) { [1.0, 0.0, 0.0, 1.0] } else { far(x, y).map(|value| 0.5 * value) };
    assert_near(&project.picture(), known, 1e-6);
    // The plan draws into a target that nothing reads, because the buffers that are stored there are read.
    let target = format!(r#"<renderTarget name="t" fromLibrary="L"/>{MAPS}"#);
    let project = Project::new(&format!("{}{QUAD}", draw("draw", &target)), [NEAR, FAR, TABLE]);
    assert_near(&project.picture(), far, 1e-6);
}

/// An injection binds the buffers and images of its `<map>`, and none of the material that the shader is from.
#[test]
fn injections_bind_buffers_and_images() {
    if !has_driver() {
        return;
    }
    let store = "#version 430
layout(binding = 2, offset = 12) uniform atomic_uint all;
layout(binding = 5) writeonly uniform image2D kept;
out vec4 color;
void main() {
    atomicCounterIncrement(all);
    if (gl_FragCoord.z < 0.55) imageStore(kept, ivec2(gl_FragCoord.xy), vec4(gl_FragCoord.xy / 64.0, 0.25, 1.0));
    color = vec4(1.0);
}
";
    let map = |bound: &str| {
        format!(
            r#"<injectionMaps><map toMaterial="*"><shader fromMaterial="near" fromLibrary="L"/>{bound}</map></injectionMaps>"#
        )
    };
    let passes = format!("{}{QUAD}", draw("draw", &map(BINDINGS)));
    let counted = Project::new(&passes, [store, FAR, SHOW]).picture();
    assert_near(&counted, |_, _| [0.0, 0.0, 0.0, 1.25], 0.0);
    let show = r#"<pass class="quad" name="show"><texture name="image" fromLibrary="L"/></pass>"#;
    let passes = format!("{}{show}", draw("draw", &map(BINDINGS)));
    let known = |x: u32, y: u32| match (16..48).contains(&x) && (16..48).contains(&y) {
        true => [(x as f32 + 0.5) / 64.0, (63.5 - y as f32) / 64.0, 0.25, 1.0],
        false => [0.0; 4],
    };
    assert_near(&Project::new(&passes, [store, FAR, SHOW]).picture(), known, 1e-6);
    let said = Project::new(&format!("{}{QUAD}", draw("draw", &map(""))), [NEAR, FAR, SHOW]).refused();
    assert!(
        said.contains("near.frag:2:") && said.contains("the injection of `near` binds no ATOMIC_COUNTER to point 2"),
        "{said}"
    );
    assert!(said.contains("in the <buffers> of the <map>"), "{said}");
}

#[test]
fn what_is_wrong_is_said_with_its_place() {
    let passes = format!("{}{QUAD}", draw("draw", MAPS));
    let say = |near: &str| Project::new(&passes, [near, FAR, SHOW]).refused();
    // This layout promises that hidden pixels store nothing, but they would store as well.
    let said = say(&NEAR.replace("out vec4", "layout(early_fragment_tests) in;\nout vec4"));
    assert!(said.contains("near.frag:4:8") && said.contains("hidden pixels store nothing"), "{said}");
    let said = say(&NEAR.replace("binding = 2", "binding = 4"));
    assert!(
        said.contains("near.frag:2:") && said.contains("material `near` binds no ATOMIC_COUNTER to point 4"),
        "{said}"
    );
    // One shader of the pass samples the image that another stores to.
    let stores = "#version 430
layout(binding = 5) writeonly uniform image2D kept;
out vec4 color;
void main() { imageStore(kept, ivec2(0), vec4(1.0)); color = vec4(1.0); }
";
    let samples =
        "#version 430\nuniform sampler2D read;\nout vec4 color;\nvoid main() { color = texture(read, vec2(0.5)); }\n";
    let bound = r#"<textures><texture UNIT="0" name="image"/></textures><buffers>"#;
    let values = r#"<valueof uniform="pvm" type="RENDERER" context="CURRENT" component="PROJECTION_VIEW_MODEL"/>
<valueof uniform="read" type="TEXTURE_BINDING" context="CURRENT" component="UNIT" id="0"/>"#;
    let library = LIBRARY.replace("VALUES", values).replace("BINDINGS", &BINDINGS.replacen("<buffers>", bound, 1));
    let said = Project::new(&draw("draw", MAPS), [stores, samples, SHOW]).with("p.mlib", &library).refused();
    assert!(said.contains("p.xml:") && said.contains("pass `draw` samples `L::image`, to which it stores"), "{said}");
    // The pass's own target cannot be an image.
    let library = LIBRARY
        .replace("VALUES", values)
        .replace("BINDINGS", &BINDINGS.replace(r#"texture="image""#, r#"texture="drawn""#));
    let into = format!(r#"<renderTarget name="t" fromLibrary="L"/>{MAPS}"#);
    let said = Project::new(&format!("{}{QUAD}", draw("draw", &into)), [stores, NEAR, SHOW])
        .with("p.mlib", &library)
        .refused();
    assert!(said.contains("`draw` stores to `L::drawn`, a channel of the target that it writes"), "{said}");
    // No pass stores what is read.
    let said = Project::new(&draw("draw", MAPS), [TABLE, TABLE, SHOW]).refused();
    assert!(said.contains("pass `draw` reads `L::table`, which no pass writes"), "{said}");
}
