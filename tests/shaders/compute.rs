//! Compute passes and images: pictures with known pixels, and errors with their places in the files.
//!
//! Needs the feature `glsl`. Pictures need a Vulkan, Metal or DirectX 12 driver (a software driver will do). Without one, tests print
//! `skipped`, or fail with `CURITIBA_REQUIRE_GPU_TESTS=1`.

use curitiba::pipeline::executor::{Renderer, Silent};
use curitiba::pipeline::plan::Settings;
use curitiba::{Choice, OpenError, RasterChoice};
use std::path::{Path, PathBuf};

const MADE: &str = "#version 430
layout(local_size_x = 8, local_size_y = 4) in;
uniform writeonly image2D result;
void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID);
    imageStore(result, at, vec4(vec2(at) / 64.0, float(imageSize(result).y) / 128.0, 1.0));
}
";

/// A project in a folder of its own: a compute pass `make` stores to the image `made`, and another pass may follow. The window shows an image.
struct Project {
    folder: tempfile::TempDir,
}

impl Project {
    /// Arguments: the compute shader, the format of images, the workgroups of the first pass, and the passes after it.
    fn new(make: &str, format: &str, groups: &str, passes: &str) -> Self {
        let library = LIBRARY.replace("HELD_AS", format);
        let project = PROJECT.replace("GROUPS", groups).replace("PASSES", passes);
        let vertex = "#version 430\nin vec4 position;\nvoid main() { gl_Position = position; }\n";
        Self::of(&[("p.xml", &project), ("p.mlib", &library), ("make.comp", make), ("quad.vert", vertex)])
    }

    fn of(files: &[(&str, &str)]) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        for (name, text) in files {
            std::fs::write(folder.path().join(name), text).expect("written");
        }
        Self { folder }
    }

    fn with(self, name: &str, text: &str) -> Self {
        std::fs::write(self.folder.path().join(name), text).expect("written");
        self
    }

    fn path(&self) -> PathBuf {
        self.folder.path().join("p.xml")
    }

    fn open(&self) -> Result<Renderer, OpenError> {
        open(&self.path())
    }

    fn refused(&self) -> String {
        self.open().err().map_or_else(|| panic!("it is refused"), |error| error.joined())
    }
}

fn open(path: &Path) -> Result<Renderer, OpenError> {
    let choice = Choice { raster: RasterChoice::Auto, ..Choice::CPU };
    curitiba::open(path, Settings::default(), choice, &mut Silent)
}

const LIBRARY: &str = r#"<materialLib name="L">
<textures>
<texture name="made"><WIDTH value="64"/><HEIGHT value="64"/><INTERNAL_FORMAT value="HELD_AS"/></texture>
<texture name="other"><WIDTH value="64"/><HEIGHT value="64"/><INTERNAL_FORMAT value="RGBA32F"/></texture>
</textures>
<shaders><shader name="make" cs="make.comp"/><shader name="next" cs="next.comp"/><shader name="quad" vs="quad.vert" ps="quad.frag"/></shaders>
<materials>
<material name="make"><shader name="make"><values>
<valueof uniform="result" type="IMAGE_TEXTURE" component="UNIT" id="2"/>
</values></shader><imageTextures>
<imageTexture UNIT="2" texture="made"><ACCESS value="WRITE_ONLY"/><LEVEL value="0"/></imageTexture>
</imageTextures></material>
<material name="next"><shader name="next"><values>
<valueof uniform="before" type="TEXTURE_BINDING" context="CURRENT" component="UNIT" id="0"/>
</values></shader><textures><texture UNIT="0" name="made"/></textures><imageTextures>
<imageTexture UNIT="0" texture="other"><ACCESS value="READ_WRITE"/></imageTexture>
</imageTextures></material>
<material name="quad"><shader name="quad"/><imageTextures><imageTexture UNIT="1" texture="other"/></imageTextures></material>
</materials></materialLib>"#;

const PROJECT: &str = r#"<project name="p" width="64" height="64"><assets>
<materialLibs><materialLib filename="p.mlib"/></materialLibs>
</assets><pipelines><pipeline name="p" default="true">
<pass class="compute" name="make"><material name="make" fromLibrary="L" GROUPS/></pass>
PASSES
</pipeline></pipelines></project>"#;

const ALL: &str = r#"dimX="8" dimY="16" dimZ="1""#;
const SHOW_MADE: &str = r#"<pass class="quad" name="show"><texture name="made" fromLibrary="L"/></pass>"#;
const SHOW_OTHER: &str = r#"<pass class="quad" name="show"><texture name="other" fromLibrary="L"/></pass>"#;

mod run {
    use super::*;
    use crate::own_shaders::{assert_near, has_driver};
    use curitiba::pipeline::image::Image;
    use curitiba::pipeline::plan::Work;
    use curitiba::pipeline::project::ChannelRef;

    fn picture(project: &Project) -> Image {
        let mut renderer = project.open().unwrap_or_else(|error| panic!("{}", error.joined()));
        assert_eq!(renderer.engines().raster.name(), "wgpu", "auto takes what runs compute shaders");
        let first = renderer.frame(&mut Silent).expect("it renders");
        // Every frame begins with zeros.
        assert_eq!(renderer.frame(&mut Silent).expect("it renders").pixels, first.pixels, "a second frame");
        first
    }

    /// The value that [`MADE`] stores; rows count upwards.
    fn made(x: u32, y: u32) -> [f32; 4] {
        [x as f32 / 64.0, (63 - y) as f32 / 64.0, 0.5, 1.0]
    }

    #[test]
    fn every_work_group_of_the_project_runs_and_no_other() {
        if !has_driver() {
            return;
        }
        let whole = picture(&Project::new(MADE, "RGBA32F", ALL, SHOW_MADE));
        assert_near(&whole, made, 0.0);
        // Half as many columns of groups and a quarter of the rows: the rest of the image stays zero. Some files have a comma after a number.
        let part = picture(&Project::new(MADE, "RGBA32F", r#"dimX="4," dimY="4""#, SHOW_MADE));
        assert_near(&part, |x, y| if x < 32 && y >= 48 { made(x, y) } else { [0.0; 4] }, 0.0);
        // Groups beyond the image store nothing.
        let more = picture(&Project::new(MADE, "RGBA32F", r#"dimX="9" dimY="20" dimZ="2""#, SHOW_MADE));
        assert_near(&more, made, 0.0);
    }

    #[test]
    fn stored_colours_are_rounded_to_the_format() {
        if !has_driver() {
            return;
        }
        let make =
            MADE.replace("vec4(vec2(at) / 64.0, float(imageSize(result).y) / 128.0, 1.0)", "vec4(0.3, 1.7, -1.0, 0.1)");
        let of = |format: &str| picture(&Project::new(&make, format, ALL, SHOW_MADE));
        assert_near(&of("RGBA32F"), |_, _| [0.3, 1.7, -1.0, 0.1], 0.0);
        let byte = |value: f32| (value * 255.0).round() / 255.0;
        assert_near(&of("RGBA"), |_, _| [byte(0.3), 1.0, 0.0, byte(0.1)], 0.0);
        // The nearest numbers with 11 binary digits.
        let half = [1229.0 / 4096.0, 1741.0 / 1024.0, -1.0, 1638.0 / 16384.0];
        assert_near(&of("RGBA16F"), |_, _| half, 0.0);
        assert_near(&of("RG32F"), |_, _| [0.3, 1.7, 0.0, 1.0], 0.0);
    }

    /// A second pass samples the output of the first, turns it in shared memory, and loads its own stored values.
    #[test]
    fn passes_hand_images_on() {
        if !has_driver() {
            return;
        }
        let next = "#version 430
layout(local_size_x = 8, local_size_y = 8) in;
layout(rgba32f) uniform image2D result;
uniform sampler2D before;
shared vec4 tile[8][8];
void main() {
    ivec2 own = ivec2(gl_LocalInvocationID.xy), group = 8 * ivec2(gl_WorkGroupID.xy);
    tile[own.x][own.y] = texelFetch(before, group + own, 0);
    memoryBarrierShared();
    barrier();
    vec4 turned = tile[own.y][own.x];
    imageStore(result, group + own, imageLoad(result, group + own) + vec4(0.25));
    imageStore(result, group + own, imageLoad(result, group + own) + turned + imageLoad(result, ivec2(-1, 64)));
}
";
        let pass =
            r#"<pass class="compute" name="next"><material name="next" fromLibrary="L" dimX="8" dimY="8"/></pass>"#;
        let project = Project::new(MADE, "RGBA32F", ALL, &format!("{pass}{SHOW_OTHER}")).with("next.comp", next);
        // Each tile of 8 x 8 is transposed; rows count upwards.
        let known = |x: u32, y: u32| {
            let up = 63 - y;
            let (column, row) = (x / 8 * 8 + up % 8, up / 8 * 8 + x % 8);
            [0.25 + column as f32 / 64.0, 0.25 + row as f32 / 64.0, 0.75, 1.25]
        };
        assert_near(&picture(&project), known, 0.0);
        // The plan runs the first pass if the second reads its image, and leaves it out if nothing reads it.
        let runs = |project: &Project| {
            let renderer = project.open().unwrap_or_else(|error| panic!("{}", error.joined()));
            let plan = renderer.plan();
            let passes = plan.passes.iter().filter(|planned| planned.work == Work::Compute);
            passes.map(|planned| plan.pass(planned).name.clone()).collect::<Vec<_>>()
        };
        assert_eq!(runs(&project), ["make", "next"]);
        let alone = next.replace("texelFetch(before, group + own, 0)", "vec4(0.5)");
        let project = Project::new(MADE, "RGBA32F", ALL, &format!("{pass}{SHOW_OTHER}")).with("next.comp", &alone);
        assert_eq!(runs(&project), ["next"]);
    }

    #[test]
    fn quads_store_to_images() {
        if !has_driver() {
            return;
        }
        let quad = "#version 430
layout(binding = 1) writeonly uniform image2D kept;
out vec4 color;
void main() {
    imageStore(kept, ivec2(gl_FragCoord.yx), vec4(gl_FragCoord.xy / 64.0, 0.0, 1.0));
    color = vec4(1.0);
}
";
        let pass = r#"<pass class="quad" name="store"><material name="quad" fromLibrary="L"/></pass>"#;
        let project = Project::new(MADE, "RGBA32F", ALL, &format!("{pass}{SHOW_OTHER}")).with("quad.frag", quad);
        let known = |x: u32, y: u32| [(63.5 - y as f32) / 64.0, (x as f32 + 0.5) / 64.0, 0.0, 1.0];
        assert_near(&picture(&project), known, 1e-6);
    }

    /// A quad cannot store to its own target.
    #[test]
    fn what_a_quad_draws_into_is_no_image_of_it() {
        let quad = "#version 430
layout(binding = 1) writeonly uniform image2D kept;
out vec4 color;
void main() { imageStore(kept, ivec2(0), vec4(1.0)); color = vec4(1.0); }
";
        let target = r#"<renderTargets><renderTarget name="t"><SIZE width="64" height="64"/><colors><color name="drawn" internalFormat="RGBA"/></colors></renderTarget></renderTargets>
<shaders>"#;
        let library = LIBRARY.replace("HELD_AS", "RGBA").replace("<shaders>", target);
        let library = library.replace(r#"UNIT="1" texture="other""#, r#"UNIT="1" texture="drawn""#);
        let into = |target: &str| {
            let pass =
                format!(r#"<pass class="quad" name="store">{target}<material name="quad" fromLibrary="L"/></pass>"#);
            let show = r#"<pass class="quad" name="show"><texture name="drawn" fromLibrary="L"/></pass>"#;
            let project = Project::new(MADE, "RGBA", ALL, &format!("{pass}{show}"));
            project.with("quad.frag", quad).with("p.mlib", &library)
        };
        let said = into(r#"<renderTarget name="t" fromLibrary="L"/>"#).refused();
        assert!(
            said.contains("p.xml:5:") && said.contains("`store` stores to `L::drawn`, a channel of the target"),
            "{said}"
        );
        // Control: a quad that draws into the window can.
        if has_driver() {
            assert!(into("").open().is_ok());
        }
    }

    /// A store to a unit without a bound image is lost, with a warning, as in OpenGL.
    #[test]
    fn an_image_of_nothing_holds_nothing() {
        if !has_driver() {
            return;
        }
        let make = MADE.replace("uniform writeonly", "layout(binding = 7) uniform image2D nothing;\nuniform writeonly").replace(
            "imageStore(result, at, vec4(",
            "imageStore(nothing, ivec2(0), vec4(9.0));\nimageStore(result, at, imageLoad(nothing, ivec2(0)) + float(imageSize(nothing).x) + vec4(",
        );
        let project = Project::new(&make, "RGBA32F", ALL, SHOW_MADE);
        assert_near(&picture(&project), made, 0.0);
        let renderer = project.open().unwrap_or_else(|error| panic!("{}", error.joined()));
        let said = renderer.plan().project.problems.to_string();
        assert!(said.contains("binds nothing to image unit 7 of `nothing`"), "{said}");
    }

    /// Each element of an array is a texture of its own, for images and for samplers.
    #[test]
    fn arrays_of_textures_are_bound_from_a_first_unit_on() {
        if !has_driver() {
            return;
        }
        let library = r#"<materialLib name="L">
<arraysOfTextures>
<arrayOfTextures name="A"><TEXTURE_COUNT value="2"/><WIDTH value="64"/><HEIGHT value="64"/><INTERNAL_FORMAT value="RGBA32F"/></arrayOfTextures>
<arrayOfTextures name="B"><TEXTURE_COUNT value="2"/><WIDTH value="64"/><HEIGHT value="64"/><INTERNAL_FORMAT value="RGBA32F"/></arrayOfTextures>
</arraysOfTextures>
<shaders><shader name="make" cs="make.comp"/><shader name="quad" vs="quad.vert" ps="quad.frag"/></shaders>
<materials>
<material name="make"><shader name="make"><values>
<valueof uniform="a[0]" type="ARRAY_OF_IMAGE_TEXTURES" context="CURRENT" component="SAMPLER_ARRAY" id="0"/>
<valueof uniform="b[0]" type="ARRAY_OF_IMAGE_TEXTURES" context="CURRENT" component="SAMPLER_ARRAY" id="1"/>
</values></shader><arraysOfImageTexture>
<arrayOfImageTexture textureArray="A" FIRST_UNIT="4"/><arrayOfImageTexture textureArray="B" FIRST_UNIT="2"/>
</arraysOfImageTexture></material>
<material name="quad"><shader name="quad"><values>
<valueof uniform="first[0]" type="ARRAY_OF_TEXTURES_BINDING" context="CURRENT" component="SAMPLER_ARRAY" id="0"/>
<valueof uniform="second[0]" type="ARRAY_OF_TEXTURES_BINDING" context="CURRENT" component="SAMPLER_ARRAY" id="ID"/>
</values></shader><arraysOfTextures>
<arrayOfTextures name="A" firstUnit="0"/><arrayOfTextures name="B" firstUnit="6"/>
</arraysOfTextures></material>
</materials></materialLib>"#;
        let make = "#version 430
layout(local_size_x = 8, local_size_y = 4) in;
uniform writeonly image2D a[2], b[2];
void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID);
    imageStore(a[0], at, vec4(0.1));
    imageStore(a[1], at, vec4(0.2));
    imageStore(b[0], at, vec4(0.3));
    imageStore(b[1], at, vec4(0.4));
}
";
        let quad = "#version 430
uniform sampler2D first[2], second[2];
out vec4 color;
void main() {
    ivec2 at = ivec2(0);
    color = vec4(texelFetch(first[0], at, 0).x, texelFetch(first[1], at, 0).x, texelFetch(second[0], at, 0).x, texture(second[1], vec2(0.5)).x);
}
";
        let pass = r#"<pass class="quad" name="show"><material name="quad" fromLibrary="L"/></pass>"#;
        let project = || Project::new(make, "", ALL, pass).with("quad.frag", quad);
        let of = |id: &str| project().with("p.mlib", &library.replace("id=\"ID\"", &format!("id=\"{id}\"")));
        assert_near(&picture(&of("1")), |_, _| [0.1, 0.2, 0.3, 0.4], 1e-6);
        assert_near(&picture(&of("0")), |_, _| [0.1, 0.2, 0.1, 0.2], 1e-6);
        let said = of("2").refused();
        assert!(said.contains("p.mlib:16:") && said.contains("binds 2 such arrays"), "{said}");
    }

    /// The shipped project draws what its shader computes.
    #[test]
    fn the_shipped_project_draws_outlines() {
        if !has_driver() {
            return;
        }
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects/shaders/Compute.xml");
        let mut renderer = open(&path).unwrap_or_else(|error| panic!("{}", error.joined()));
        let picture = renderer.frame(&mut Silent).expect("it renders");
        let project = &renderer.plan().project;
        let target = project.targets.iter().position(|target| target.name == "deferred").expect("it is there");
        let of = |channel: usize| renderer.channel(ChannelRef { target, channel }).to_vec();
        let (paint, normals, side) = (of(0), of(2), 512_i32);
        let mut inked = 0;
        for (index, pixel) in picture.pixels.iter().enumerate() {
            let (x, y) = (index as i32 % side, index as i32 / side);
            let at = |x: i32, y: i32| normals[(y.clamp(0, side - 1) * side + x.clamp(0, side - 1)) as usize];
            let around = [at(x + 1, y), at(x - 1, y), at(x, y + 1), at(x, y - 1)];
            let bend = (0..3)
                .map(|axis| (4.0 * at(x, y)[axis] - around.iter().map(|normal| normal[axis]).sum::<f32>()).powi(2));
            let ink = (0.5 * bend.sum::<f32>().sqrt()).min(1.0);
            inked += usize::from(ink > 0.5);
            for axis in 0..3 {
                let known = paint[index][axis] * (1.0 - ink);
                assert!((pixel[axis] - known).abs() < 1e-3, "pixel {x}, {y}: {pixel:?}, and {known} is right");
            }
        }
        assert!(inked > 5000, "{inked} pixels of outlines");
    }

    /// Each mistake is an error with its place and the valid values.
    #[test]
    fn what_is_wrong_is_said_with_its_place() {
        let say =
            |make: &str, format: &str, groups: &str, passes: &str| Project::new(make, format, groups, passes).refused();
        let shader = |from: &str, to: &str| {
            assert!(MADE.contains(from), "{from}");
            say(&MADE.replace(from, to), "RGBA32F", ALL, SHOW_MADE)
        };
        let layout = "layout(local_size_x = 8, local_size_y = 4) in;\n";
        let cases = [
            (say(MADE, "RGBA32F", r#"dimX="0""#, SHOW_MADE), "p.xml:4:", "`0` is no number of work groups"),
            (say(MADE, "RGBA32F", r#"dimX="65536""#, SHOW_MADE), "p.xml:4:", "valid: 1 to 65535"),
            (say(MADE, "RGBA32F", r#"dimX="65535" dimY="65535""#, SHOW_MADE), "p.xml:4:", "137434759200 invocations"),
            (say(MADE, "RGBA32F", r#"bufferX="L::groups" offsetX="0""#, SHOW_MADE), "p.xml:4:", "valid: dimX=\"64\""),
            (say(MADE, "RGB9E5", ALL, SHOW_MADE), "p.mlib:3:", "`RGB9E5` is not a format"),
            (shader(layout, ""), "make.comp:2:", "the size of work groups is not declared"),
            (shader("local_size_y = 4", "local_size_y = 64"), "make.comp:2:", "8 x 64 x 1 invocations"),
            (shader("local_size_y = 4", "local_size_y = 0"), "make.comp:2:", "`0` is no local_size_y"),
            (shader("image2D", "image3D"), "make.comp:3:", "images of this type are not supported"),
            (shader("result;", "result[2];"), "make.comp:6:", "in arrays with a number"),
            (shader("imageStore(result", "imageStore(rest"), "make.comp:6:", "`rest` is not an image"),
            (
                shader("imageStore(result, at, vec4(", "imageAtomicAdd(result, at, uint("),
                "make.comp:6:",
                "`imageAtomicAdd` is not",
            ),
            (shader("float(imageSize(result).y)", "nothing"), "make.comp:6:", "nothing"),
        ];
        for (said, place, what) in cases {
            assert!(said.contains(place) && said.contains(what), "`{place}` and `{what}`: {said}");
        }
        // Mistakes in the project's files.
        let edited = |from: &str, to: &str| {
            let project = Project::new(MADE, "RGBA32F", ALL, SHOW_MADE);
            let edit =
                |text: &str| text.replace("HELD_AS", "RGBA32F").replace("GROUPS", ALL).replace("PASSES", SHOW_MADE);
            let (library, passes) = (edit(LIBRARY), edit(PROJECT));
            assert!(library.contains(from) || passes.contains(from), "{from}");
            project.with("p.mlib", &library.replace(from, to)).with("p.xml", &passes.replace(from, to)).refused()
        };
        let once = r#"<pass class="compute" name="make">"#;
        let scripted = format!(r#"{once}<testScript file="a.lua" script="b" TEST_MODE="RUN_WHILE"/>"#);
        let level = r#"<ACCESS value="WRITE_ONLY"/><LEVEL value="0"/>"#;
        let cases = [
            (edited(r#"cs="make.comp""#, r#"cs="makes.comp""#), "p.mlib:6:", "makes.comp"),
            (edited(r#"cs="make.comp""#, r#"vs="quad.vert" ps="quad.frag""#), "p.xml:4:", "has no compute shader (cs)"),
            (edited(r#"texture="made""#, r#"texture="mad""#), "p.mlib:", "there is no texture `mad`"),
            (edited(level, r#"<LEVEL value="1"/>"#), "p.mlib:", "binds level 1"),
            (edited(once, &scripted), "p.xml:4:", "a.lua: "),
            (
                edited(r#"type="IMAGE_TEXTURE" component="UNIT""#, r#"type="IMAGE_TEXTURE" component="UNITS""#),
                "p.mlib:",
                "UNITS",
            ),
            (
                edited("<material name=\"make\" fromLibrary=\"L\" dimX=\"8\" dimY=\"16\" dimZ=\"1\"/>", ""),
                "p.xml:4:1",
                "names no material",
            ),
            (
                edited(r#"<texture name="made" fromLibrary="L"/>"#, r#"<texture name="other" fromLibrary="L"/>"#),
                "p.xml:5:",
                "which no pass writes",
            ),
        ];
        for (said, place, what) in cases {
            assert!(said.contains(place) && said.contains(what), "`{place}` and `{what}`: {said}");
        }
        let said = shader(
            "imageStore(result, at, vec4(vec2(at) / 64.0, float(imageSize(result).y) / 128.0, 1.0));",
            "imageLoad(result, at);",
        );
        assert!(said.contains("p.xml:4:") && said.contains("stores to no image and no buffer"), "{said}");
        // The processor runs no shaders.
        let choice = Choice { raster: RasterChoice::Cpu, ..Choice::CPU };
        let project = Project::new(MADE, "RGBA32F", ALL, SHOW_MADE);
        let refused = curitiba::open(project.path(), Settings::default(), choice, &mut Silent).err();
        let said = refused.expect("it is refused").joined();
        assert!(said.contains("p.xml:4:") && said.contains("--raster"), "{said}");
    }
}
