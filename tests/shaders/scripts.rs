//! Scripts of passes, and the passes that they control: pictures with known pixels, and errors with their places in the files.
//!
//! Needs the feature `glsl`. Pictures need a Vulkan, Metal or DirectX 12 driver (a software driver will do). Without one, tests print
//! `skipped`, or fail with `CURITIBA_REQUIRE_GPU_TESTS=1`.

use crate::own_shaders::{assert_near, has_driver};
use curitiba::pipeline::executor::{Renderer, Silent, StepKind};
use curitiba::pipeline::image::Image;
use curitiba::pipeline::plan::Settings;
use curitiba::pipeline::project::{self, Project, Scripted};
use curitiba::{Choice, OpenError, RasterChoice};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Side of the picture whose mean is computed, and its last mip level, which has one texel.
const SIDE: u32 = 64;
const LAST: u32 = 6;

/// Halves a picture until one texel is left.
const HALVE: &str = r#"
function halve()
    local level, last = {}, {}
    getAttr("PASS", "CURRENT", "Level", 0, level)
    getAttr("RENDERER", "CURRENT", "LAST", 0, last)
    if level[1] >= last[1] then
        return false
    end
    level[1] = level[1] + 1
    local groups = { 2 ^ (last[1] - level[1]) }
    setAttr("PASS", "CURRENT", "Level", 0, level)
    setAttr("PASS", "p#halve", "DIM_X", 0, groups)
    setAttr("PASS", "CURRENT", "DIM_Y", 0, groups)
    setAttr("IMAGE_TEXTURE", "L::halve", "LEVEL", 3, level)
    return true
end
"#;

const FILES: [(&str, &str); 7] = [
    ("p.xml", PROJECT),
    ("p.mlib", LIBRARY),
    ("s.lua", HALVE),
    ("quad.vert", "#version 430\nuniform mat4 pvm;\nin vec4 position;\nvoid main() { gl_Position = pvm * position; }\n"),
    // The value of a texel is x / 64 + y, where rows count upwards.
    ("fill.comp", "#version 430
layout(local_size_x = 8, local_size_y = 8) in;
uniform writeonly image2D filled;
void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID);
    float value = float(at.x) / 64.0 + float(at.y);
    imageStore(filled, at, vec4(value, value, 0.0, 1.0));
}
"),
    // Mean and maximum of four texels of the previous level.
    ("halve.comp", "#version 430
layout(local_size_x = 1) in;
uniform int level;
uniform sampler2D source;
layout(binding = 3, rgba32f) writeonly uniform image2D halved;
void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID);
    vec2 a = texelFetch(source, 2 * at, level - 1).rg, b = texelFetch(source, 2 * at + ivec2(1, 0), level - 1).rg;
    vec2 c = texelFetch(source, 2 * at + ivec2(0, 1), level - 1).rg, d = texelFetch(source, 2 * at + ivec2(1, 1), level - 1).rg;
    float most = max(max(a.g, b.g), max(c.g, d.g));
    imageStore(halved, at, vec4(0.25 * (a.r + b.r + c.r + d.r), most, 0.0, 1.0));
}
"),
    // Nine columns of each level.
    ("show.frag", "#version 430
uniform sampler2D chain;
uniform float gain;
out vec4 color;
void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    int level = min(at.x / 9, 6);
    color = vec4(gain * texelFetch(chain, at >> level, level).rg / 64.0, 0.0, 1.0);
}
"),
];

const PROJECT: &str = r#"<project name="p" width="64" height="64"><assets>
<aliases><alias name="SIDE" value="64"/></aliases>
<attributes>
<attribute type="PASS" name="Level" data="INT" value="0"/>
<attribute type="RENDERER" name="LAST" data="INT" value="6"/>
<attribute type="RENDERER" name="GAIN" data="FLOAT" value="1"/>
</attributes>
<materialLibs><materialLib filename="p.mlib"/></materialLibs>
</assets><pipelines><pipeline name="p" default="true">
<pass class="compute" name="fill"><material name="fill" fromLibrary="L" dimX="8" dimY="8"/></pass>
<pass class="compute" name="halve">
<testScript file="s.lua" script="halve" TEST_MODE="RUN_WHILE"/>
<material name="halve" fromLibrary="L" dimX="1" dimY="1" dimZ="1"/>
</pass>
<pass class="quad" name="show"><material name="show" fromLibrary="L"/></pass>
</pipeline></pipelines></project>"#;

const LIBRARY: &str = r#"<materialLib name="L">
<textures><texture name="chain"><WIDTH value="SIDE"/><HEIGHT value="SIDE"/><INTERNAL_FORMAT value="RGBA32F"/><LEVELS value="6"/></texture></textures>
<shaders><shader name="fill" cs="fill.comp"/><shader name="halve" cs="halve.comp"/><shader name="show" vs="quad.vert" ps="show.frag"/></shaders>
<materials>
<material name="fill"><shader name="fill"><values>
<valueof uniform="filled" type="IMAGE_TEXTURE" context="CURRENT" component="UNIT" id="0"/>
</values></shader><imageTextures><imageTexture UNIT="0" texture="chain"><LEVEL value="0"/></imageTexture></imageTextures></material>
<material name="halve"><shader name="halve"><values>
<valueof uniform="level" type="PASS" context="CURRENT" component="Level"/>
<valueof uniform="source" type="TEXTURE_BINDING" context="CURRENT" component="UNIT" id="1"/>
<valueof uniform="halved" type="IMAGE_TEXTURE" context="CURRENT" component="UNIT" id="3"/>
</values></shader><imageTextures><imageTexture UNIT="3" texture="chain"><LEVEL value="1"/></imageTexture></imageTextures>
<textures><texture UNIT="1" name="chain"/></textures></material>
<material name="show"><shader name="show"><values>
<valueof uniform="pvm" type="RENDERER" context="CURRENT" component="PROJECTION_VIEW_MODEL"/>
<valueof uniform="gain" type="RENDERER" context="CURRENT" component="GAIN"/>
<valueof uniform="chain" type="TEXTURE_BINDING" context="CURRENT" component="UNIT" id="0"/>
</values></shader><textures><texture UNIT="0" name="chain"/></textures></material>
</materials></materialLib>"#;

/// A project in a folder of its own.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        let folder = Self(tempfile::tempdir().expect("a folder"));
        FILES.iter().fold(folder, |folder, (name, text)| folder.with(name, text))
    }

    fn with(self, name: &str, text: &str) -> Self {
        std::fs::write(self.0.path().join(name), text).expect("written");
        self
    }

    fn edited(self, name: &str, from: &str, to: &str) -> Self {
        let text = std::fs::read_to_string(self.0.path().join(name)).expect("it is there");
        assert!(text.contains(from), "{from}");
        self.with(name, &text.replace(from, to))
    }

    fn path(&self) -> PathBuf {
        self.0.path().join("p.xml")
    }

    fn loaded(&self) -> Project {
        project::load(&self.path()).unwrap_or_else(|problems| panic!("{problems}"))
    }

    fn refused(&self) -> String {
        project::load(&self.path()).err().map_or_else(|| panic!("it is refused"), |problems| problems.to_string())
    }

    fn open(&self) -> Result<Renderer, OpenError> {
        let choice = Choice { raster: RasterChoice::Auto, ..Choice::CPU };
        curitiba::open(self.path(), Settings::default(), choice, &mut Silent)
    }

    fn picture(&self) -> Image {
        let mut renderer = self.open().unwrap_or_else(|error| panic!("{}", error.joined()));
        let first = renderer.frame(&mut Silent).expect("it renders");
        assert_eq!(renderer.frame(&mut Silent).expect("it renders").pixels, first.pixels, "a second frame");
        let rows = &renderer.timeline().rows;
        let halved: Vec<_> = rows.iter().filter(|row| row.kind == StepKind::Quad && row.name == "halve").collect();
        assert!(halved.iter().all(|row| row.host_ms.len() == 2), "one time a frame for all runs");
        first
    }
}

/// The mean and the maximum of the texels of level 0 that a texel of a level covers; the value of a texel at level 0 is x / 64 + y.
fn under(level: u32, x: u32, y: u32) -> [f32; 2] {
    let side = 1 << level;
    let (mean, most) = ((side - 1) as f32 / 2.0, (side - 1) as f32);
    [mean, most].map(|beyond| ((x * side) as f32 + beyond) / 64.0 + (y * side) as f32 + beyond)
}

#[test]
fn a_mip_chain_of_a_script_holds_the_means() {
    if !has_driver() {
        return;
    }
    let expected = |gain: f32| {
        move |x: u32, y: u32| {
            let level = (x / 9).min(LAST);
            let [mean, most] = under(level, x >> level, (SIDE - 1 - y) >> level);
            [gain * mean / 64.0, gain * most / 64.0, 0.0, 1.0]
        }
    };
    assert_eq!(under(LAST, 0, 0), [31.5 + 31.5 / 64.0, 63.0 + 63.0 / 64.0], "of all texels");
    assert_near(&Folder::new().picture(), expected(1.0), 1e-6);
    // A script before a pass sets values for the pass's shader, and not for shaders of earlier passes.
    let before = r#"<pass class="quad" name="show"><preScript file="s.lua" script="dim"/>"#;
    let dim = format!("{HALVE}function dim() setAttr('RENDERER', 'CURRENT', 'GAIN', 0, {{0.5}}) end");
    let dimmed = Folder::new().with("s.lua", &dim).edited("p.xml", r#"<pass class="quad" name="show">"#, before);
    assert_near(&dimmed.picture(), expected(0.5), 1e-6);
}

#[test]
fn runs_of_a_pass_have_the_work_groups_and_levels_that_the_script_sets() {
    let loaded = Folder::new().loaded();
    let passes = &loaded.pipelines[0].passes;
    assert_eq!(passes.len() as u32, 2 + LAST);
    for (run, pass) in (1..).zip(&passes[1..=LAST as usize]) {
        let project::PassKind::Compute(compute) = &pass.kind else { panic!("it computes") };
        let side = 1 << (LAST - run);
        let Some(Scripted { run: counted, told }) = &pass.scripted else { panic!("it is scripted") };
        assert_eq!((compute.groups, *counted, pass.name.as_str()), ([side, side, 1], run, "halve"));
        assert!(told.contains(&format!("Level of `p#halve` = {run}")) && told.contains("`halve` of `s.lua`"), "{told}");
        let target = &loaded.targets[compute.stored];
        assert_eq!((target.size, target.name.as_str()), ([side; 2], format!("chain, level {run}").as_str()));
    }
    assert!(passes[0].scripted.is_none() && passes[7].scripted.is_none());
    assert!(loaded.problems.0.is_empty(), "{}", loaded.problems);
}

#[test]
fn a_script_says_whether_a_pass_runs() {
    let asked = |answer: &str| {
        let test = r#"<pass class="quad" name="show"><testScript file="s.lua" script="shows"/>"#;
        Folder::new().with("s.lua", &format!("{HALVE}function shows() return {answer} end")).edited(
            "p.xml",
            r#"<pass class="quad" name="show">"#,
            test,
        )
    };
    assert_eq!(asked("1 < 2").loaded().pipelines[0].passes.len(), 8);
    let never = asked("1 > 2").loaded();
    assert_eq!(never.pipelines[0].passes.len(), 7);
    assert!(never.problems.to_string().contains("pass `show` is left out: the script `shows`"), "{}", never.problems);
    let said = asked("1").refused();
    assert!(said.contains("p.xml:15:") && said.contains("returns neither true nor false"), "{said}");
}

#[test]
fn scripts_that_fail_are_errors_with_their_line_in_bounded_time() {
    let halve = |body: &str| Folder::new().with("s.lua", &format!("function halve()\n{body}\nend\n"));
    let cases = [
        ("while true do end", "s.lua:2:1", "more than 1000000 instructions"),
        ("  local s = 'ab'\n  while true do s = s .. s end", "s.lua:3:3", "more than 1024 KiB"),
        ("local t = {}\nfor i = 1, 1e9 do t[i] = i end", "s.lua:3:1", "more than 1024 KiB"),
        ("return true", "p.xml:12:", "does not end"),
        ("local a = = 1", "s.lua:2:1", "unexpected symbol"),
        ("local a\nreturn a.b", "s.lua:3:1", "attempt to index a nil value"),
        ("return os.time() > 0", "s.lua:2:1", "'os'"),
        ("return ('x'):rep(9) == ''", "s.lua:2:1", "'rep'"),
        ("return math.random() > 0.5", "s.lua:2:1", "'random'"),
        ("setBuffer('L::b', 0, 'UINT', {1})", "s.lua:2:1", "`setBuffer`: buffers are not there"),
        ("getAttr('PASS', 'CURRENT', 'Levels', 0, {})", "s.lua:2:1", "did you mean `Level`?"),
        ("getAttr('PASS', 'p#halves', 'Level', 0, {})", "s.lua:2:1", "did you mean `p#halve`?"),
        ("getAttr('CAMERA', 'Eye', 'POSITION', 0, {})", "s.lua:2:1", "scripts have no attributes of CAMERA"),
        ("getAttr('PASS', 'CURRENT', 'Level', {})", "s.lua:2:1", "`getAttr` takes a type, a context"),
        ("setAttr('PASS', 'CURRENT', 'Level', 0, {})", "s.lua:2:1", "takes a table with a number"),
        ("setAttr('PASS', 'CURRENT', 'Level', 0, {0.5})", "s.lua:2:1", "set to 0.5; valid: whole numbers"),
        ("setAttr('PASS', 'CURRENT', 'DIM_X', 0, {0})", "s.lua:2:1", "valid: 1 to 65535"),
        ("setAttr('RENDERER', 'CURRENT', 'FRAME_COUNT', 0, {0})", "s.lua:2:1", "read only"),
        (
            "setAttr('IMAGE_TEXTURE', 'L::halve', 'LEVEL', 2, {0})",
            "s.lua:2:1",
            "valid: L::fill with 0, L::halve with 3",
        ),
        ("setAttr('IMAGE_TEXTURE', 'CURRENT', 'LEVEL', 3, {7}) return true", "p.mlib:", "valid: 0 to 6"),
        ("setAttr('IMAGE_TEXTURE', 'CURRENT', 'LEVEL', 3, {0}) return true", "halve.comp:4:", "samples what an image"),
    ];
    for (body, place, what) in cases {
        let start = Instant::now();
        let said = halve(body).refused();
        assert!(said.contains(place) && said.contains(what), "{body}: {said}");
        assert!(start.elapsed() < Duration::from_secs(20), "{body}: {:?}", start.elapsed());
    }
    let missing = Folder::new().edited("p.xml", "s.lua", "t.lua").refused();
    assert!(missing.contains("p.xml:12:19") && missing.contains("t.lua"), "{missing}");
    let unnamed = Folder::new().edited("p.xml", r#"script="halve""#, r#"script="half""#).refused();
    assert!(unnamed.contains("p.xml:12:") && unnamed.contains("there is no function `half`"), "{unnamed}");
    let large = Folder::new().with("s.lua", &format!("--{}", "x".repeat(1 << 18))).refused();
    assert!(large.contains("p.xml:12:") && large.contains("larger than 256 KiB"), "{large}");
}

#[test]
fn a_script_before_a_pass_that_fails_sets_nothing_and_what_writes_files_does_nothing() {
    let before = |body: &str| {
        let script = r#"<pass class="quad" name="show"><preScript file="s.lua" script="before"/>"#;
        Folder::new()
            .with("s.lua", &format!("{HALVE}function before()\n{body}\nend"))
            .edited("p.xml", r#"<pass class="quad" name="show">"#, script)
            .loaded()
    };
    let failed = before("setAttr('RENDERER', 'CURRENT', 'GAIN', 0, {3})\nerror('enough')");
    let said = failed.problems.to_string();
    assert!(said.contains("s.lua:19:1") && said.contains("stops, and sets nothing: enough"), "{said}");
    assert!(failed.pipelines[0].passes[7].scripted.is_none(), "{:?}", failed.pipelines[0].passes[7].scripted);
    let left_out = before("local f = io.open('log', 'a') f:write('x') f:close()\nsaveTexture('L::chain') print(1)");
    let said = left_out.problems.to_string();
    assert!(said.contains("calls `io.open`, which does nothing here") && said.contains("`saveTexture`"), "{said}");
}

#[test]
fn thousands_of_runs_fit_and_scripts_of_one_pipeline_do_not_reach_another() {
    // No run leaves anything behind, so memory stays as it is.
    let many = "function halve()\n local n = {}\n getAttr('RENDERER', 'CURRENT', 'LAST', 0, n)\n n[1] = n[1] + 1\n \
                setAttr('RENDERER', 'CURRENT', 'LAST', 0, n)\n return n[1] < 4000\nend";
    let folder = Folder::new().with("s.lua", many);
    let again = "</pipeline><pipeline name=\"q\"><pass class=\"compute\" name=\"fill\">\
                 <material name=\"fill\" fromLibrary=\"L\" dimX=\"8\" dimY=\"8\"/></pass>\
                 <pass class=\"quad\" name=\"show\"><material name=\"show\" fromLibrary=\"L\"/></pass></pipeline></pipelines>";
    let loaded = folder.edited("p.xml", "</pipeline></pipelines>", again).loaded();
    assert_eq!(loaded.pipelines.iter().map(|pipeline| pipeline.passes.len()).collect::<Vec<_>>(), [3993 + 2, 2]);
    let sampled = loaded.pipelines[1].passes[1].kind.shader().map(|shader| shader.sampled().count());
    assert_eq!(sampled, Some(1), "levels that another pipeline stores are not sampled");
}

/// A ray pass passes a buffer to its device programs. The buffer holds the colours before gamma, the bottom row first.
#[test]
fn the_buffer_of_a_ray_pass_holds_its_colours_before_gamma() {
    if !has_driver() {
        return;
    }
    let project = r#"<project name="p" width="64" height="64"><assets>
<scenes><scene name="S"><geometry name="g" type="SQUARE" /></scene></scenes>
<viewports><viewport name="V"/></viewports>
<cameras><camera name="C"><viewport name="V"/><projection TYPE="PERSPECTIVE" FOV="60" NEAR="0.1" FAR="100"/>
<POSITION x="0" y="0.5" z="1"/><VIEW x="0" y="0" z="-1"/><UP x="0" y="1" z="0"/></camera></cameras>
<materialLibs><materialLib filename="p.mlib"/></materialLibs>
</assets><pipelines><pipeline name="p" default="true">
<pass class="rt" name="rays" program="albedo" gamma="2" background="black">
<scenes><scene name="S"/></scenes><camera name="C"/><renderTarget name="traced" fromLibrary="L"/>
<rtGlobalParams><param name="sums" type="BUFFER" context="L::sums" component="ID"/></rtGlobalParams>
</pass>
<pass class="quad" name="show"><material name="show" fromLibrary="L"/></pass>
</pipeline></pipelines></project>"#;
    let library = r#"<materialLib name="L">
<renderTargets><renderTarget name="traced"><SIZE width="64" height="64"/><colors><color name="traced" internalFormat="RGBA32F"/></colors></renderTarget></renderTargets>
<buffers><buffer name="sums"><DIM x="64" y="64" z="1"/><structure><field value="FLOAT"/><field value="FLOAT"/><field value="FLOAT"/><field value="FLOAT"/></structure></buffer></buffers>
<shaders><shader name="show" vs="quad.vert" ps="show.frag"/></shaders>
<materials><material name="show"><shader name="show"><values>
<valueof uniform="traced" type="TEXTURE_BINDING" context="CURRENT" component="UNIT" id="0"/>
</values></shader><textures><texture UNIT="0" name="traced"/></textures>
<buffers><buffer name="sums"><TYPE value="SHADER_STORAGE"/><BINDING_POINT value="1"/></buffer></buffers></material></materials>
</materialLib>"#;
    // The scene is the same in the left half and in the right half.
    let show = "#version 430
layout(std430, binding = 1) buffer Sums { vec4 sums[]; };
uniform sampler2D traced;
out vec4 color;
void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    vec3 shown = texelFetch(traced, at, 0).rgb;
    color = vec4(at.x < 32 ? sums[at.y * 64 + at.x].rgb : shown, 1.0);
}
";
    let vertex = "#version 430\nin vec4 position;\nvoid main() { gl_Position = position; }\n";
    let folder = Folder::new().with("p.xml", project).with("p.mlib", library).with("show.frag", show);
    let folder = folder.with("quad.vert", vertex);
    let picture = folder.picture();
    let at = |x: u32, y: u32| picture.pixels[(y * 64 + x) as usize][0];
    assert_eq!([at(31, 63), at(31, 0)], [0.8, 0.0], "the square is below");
    for (x, y) in (0..32).flat_map(|x| (0..64).map(move |y| (x, y))) {
        assert!((at(x, y).sqrt() - at(63 - x, y)).abs() < 1e-6, "at {x}, {y}");
    }
    // The picture is the same where no pass reads the buffer.
    let alone = folder.edited("show.frag", "sums[at.y * 64 + at.x].rgb", "vec3(0.0)").picture();
    assert_eq!(alone.pixels[63 * 64 + 40], picture.pixels[63 * 64 + 40]);
    let small = Folder::new().with("p.xml", project).with("p.mlib", &library.replace(r#"DIM x="64""#, r#"DIM x="32""#));
    let said = small.with("show.frag", show).with("quad.vert", vertex).refused();
    assert!(
        said.contains("p.xml:8:") && said.contains("64 x 64 colours of 16 bytes into `L::sums` of 32768 bytes"),
        "{said}"
    );
}
