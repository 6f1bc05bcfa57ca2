//! Tests of the compiler on shaders of a few lines.

use super::*;
use crate::guard;

const VERTEX: &str =
    "#version 330\nuniform mat4 pvm;\nin vec4 position;\nvoid main() { gl_Position = pvm * position; }\n";
const FRAGMENT: &str = "#version 330\nout vec4 color;\nvoid main() { color = vec4(1.0); }\n";

fn compile(vertex: &str, fragment: &str) -> Result<Program, Vec<Fault>> {
    Source { vertex, fragment, depth: None }.compile()
}

/// Line and column of each fault, from 1, with its file and message.
fn faults(vertex: &str, fragment: &str) -> Vec<(Stage, usize, usize, String)> {
    let found = compile(vertex, fragment).expect_err("it is refused");
    let place = |fault: Fault| {
        let text = if fault.stage == Stage::Vertex { vertex } else { fragment };
        let before = &text[..fault.start.min(text.len())];
        let line = before.matches('\n').count() + 1;
        let column = before.len() - before.rfind('\n').map_or(0, |newline| newline + 1) + 1;
        (fault.stage, line, column, fault.message)
    };
    found.into_iter().map(place).collect()
}

/// The one fault of a fragment shader.
fn fault(fragment: &str) -> (usize, usize, String) {
    let found = faults(VERTEX, fragment);
    assert_eq!(found.len(), 1, "{found:?}");
    assert_eq!(found[0].0, Stage::Fragment);
    (found[0].1, found[0].2, found[0].3.clone())
}

#[test]
fn a_shader_reads_and_writes_what_it_says() {
    let program = compile(VERTEX, FRAGMENT).expect("it compiles");
    assert_eq!(program.attributes, [Attribute::Position]);
    assert_eq!(program.outputs, [true, false, false]);
    let [block] = &program.blocks[..] else { panic!("{:?}", program.blocks) };
    assert_eq!((block.name.as_deref(), block.stage, block.size), (None, Stage::Vertex, 64));
    let shape = Some(Shape { scalar: Scalar::Float, columns: 4, rows: 4 });
    assert_eq!((block.members[0].name.as_str(), block.members[0].offset, block.members[0].shape), ("pvm", 0, shape));
    assert!(program.samplers.is_empty() && !program.flat);
}

/// std140: what follows a vec3 is not padded, and the columns of a 3-row matrix are 16 bytes apart.
#[test]
fn uniforms_lie_by_the_rules_of_std140_whether_in_blocks_or_not() {
    let members = "float a; vec3 b; float c; mat3 d; vec2 e; int f; vec4 g;";
    let expected = [("a", 0), ("b", 16), ("c", 28), ("d", 32), ("e", 80), ("f", 88), ("g", 96)];
    let read = "color = g + vec4(d * b, a + c + e.x + float(f));";
    let loose: String = members.split_inclusive(';').map(|member| format!("uniform {member}\n")).collect();
    for text in [loose, format!("layout(std140) uniform Block {{ {members} }};")] {
        let fragment = format!("#version 330\n{text}\nout vec4 color;\nvoid main() {{ {read} }}\n");
        let program = compile(VERTEX, &fragment).expect("it compiles");
        let block = program.blocks.iter().find(|block| block.stage == Stage::Fragment).expect("a block");
        let found: Vec<_> = block.members.iter().map(|member| (member.name.as_str(), member.offset)).collect();
        assert_eq!(found, expected, "{text}");
        assert_eq!(block.size, 112);
    }
}

#[test]
fn uniforms_keep_the_value_that_they_begin_with_and_those_that_nothing_reads_are_not_there() {
    let fragment = "#version 330\nuniform vec3 a = vec3(0.5, -1, 2);\nuniform float b = 3;\nuniform vec2 c = vec2(.25);\n\
                    uniform sampler3D unread; uniform float unread2 = sin(1.0);\n\
                    out vec4 color;\nvoid main() { color = vec4(a * b, c.x); }\n";
    let program = compile(VERTEX, fragment).expect("it compiles");
    let members: Vec<_> =
        program.blocks[1].members.iter().map(|member| (member.name.as_str(), member.default)).collect();
    let expected =
        [("a", Some([0.5, -1.0, 2.0, 0.0])), ("b", Some([3.0, 0.0, 0.0, 0.0])), ("c", Some([0.25, 0.25, 0.0, 0.0]))];
    assert_eq!(members, expected);
}

#[test]
fn samplers_are_known_by_their_place_in_a_call_and_locals_may_have_their_name() {
    let fragment = "#version 330\nuniform sampler2D noise, other;\nin vec2 uv;\nout vec4 color;\n\
                    void main() { float noise = texture(noise, uv).r; color = vec4(noise) + texelFetch(other, ivec2(0), 0); }\n";
    let vertex = "#version 330\nin vec4 position;\nin vec2 texCoord0;\nout vec2 uv;\n\
                  void main() { uv = texCoord0; gl_Position = position; }\n";
    let program = compile(vertex, fragment).expect("it compiles");
    let names: Vec<_> = program.samplers.iter().map(|sampler| sampler.name.as_str()).collect();
    assert_eq!(names, ["noise", "other"]);
    assert_eq!(program.attributes, [Attribute::Position, Attribute::TexCoord]);
    let alone = "#version 330\nuniform sampler2D a;\nout vec4 color;\nvec4 f(vec2 p) { return texture(b, p); }\n\
                 void main() { color = f(vec2(0)) + texture(a, vec2(0)); }\n";
    let (line, column, message) = fault(alone);
    assert_eq!((line, column), (4, 33), "{message}");
}

/// Interface blocks: with an instance name in the vertex stage, without one in the fragment stage. Then the older `attribute` and `varying`.
#[test]
fn what_passes_between_the_stages_is_joined_by_name() {
    let vertex = "#version 330\nin vec4 position;\nin vec3 normal;\nout Data { vec3 n; flat float f; } o;\nout vec2 unread;\n\
                  void main() { o.n = normal; o.f = 1.0; unread = vec2(0); gl_Position = position; }\n";
    let fragment = "#version 330\nin Data { vec3 n; flat float f; };\nout vec4 color;\nvoid main() { vec3 n = n * f; color = vec4(n, 1); }\n";
    let program = compile(vertex, fragment).expect("it compiles");
    assert!(program.flat);
    assert_eq!(
        program.vertex.matches("@location(").count(),
        2 + 2,
        "two attributes, two that are read: {}",
        program.vertex
    );
    let old_vertex = "#version 120\nattribute vec4 position;\nvarying vec2 p;\nvoid main() { p = position.xy; gl_Position = position; }\n";
    let old = "#version 120\nvarying vec2 p;\nuniform sampler2D t;\nvoid main() { gl_FragColor = texture2D(t, p); }\n";
    assert_eq!(compile(old_vertex, old).expect("it compiles").outputs, [true, false, false]);
    let wrong = fragment.replace("vec3 n; flat", "vec4 n; flat").replace("vec3 n = n * f", "vec3 n = n.xyz * f");
    let found = faults(vertex, &wrong);
    assert_eq!((found[0].1, found[0].2), (2, 16), "{found:?}");
    assert!(found[0].3.contains("a vec4 here and a vec3 in the vertex shader"), "{found:?}");
    let found = faults(VERTEX, fragment);
    assert!(found.iter().all(|found| found.3.contains("the vertex shader writes none of that name in a block `Data`")));
    assert_eq!(found.len(), 2);
}

/// Arrays and matrices take a location for each part.
#[test]
fn arrays_and_matrices_pass_between_the_stages_part_by_part() {
    let vertex = "#version 330\nin vec4 position;\nout vec4 p[3];\nout mat3 m;\n\
                  void main() { for (int i = 0; i < 3; i++) p[i] = position * float(i); m = mat3(2.0); gl_Position = position; }\n";
    let fragment =
        "#version 330\nin vec4 p[3];\nin mat3 m;\nout vec4 color;\nvoid main() { color = p[2] + vec4(m[1], 1.0); }\n";
    let program = compile(vertex, fragment).expect("it compiles");
    assert_eq!(program.vertex.matches("@location(").count(), 1 + 3 + 3, "{}", program.vertex);
    for (wrong, said) in [
        (
            fragment.replace("p[3]", "p[2]").replace("p[2] +", "p[1] +"),
            "`p` is a vec4[2] here and a vec4[3] in the vertex",
        ),
        (fragment.replace("mat3 m", "vec3 m[3]"), "`m` is a vec3[3] here and a mat3 in the vertex"),
    ] {
        let found = faults(vertex, &wrong);
        assert!(found.iter().any(|fault| fault.3.contains(said)), "{found:?}");
    }
    let many = |count: usize| {
        let names: Vec<String> = (0..count).map(|i| format!("vec4 q{i}[8]")).collect();
        let declared = |way: &str| names.iter().map(|name| format!("{way} {name};\n")).collect::<String>();
        let sum: String = (0..count).map(|i| format!(" + q{i}[7]")).collect();
        let vertex = format!("{}in vec4 position;\nvoid main() {{ gl_Position = position; }}\n", declared("out"));
        compile(&vertex, &format!("{}out vec4 color;\nvoid main() {{ color = vec4(1.0){sum}; }}\n", declared("in")))
    };
    assert!(many(1).is_ok());
    let found = many(2).expect_err("refused");
    assert!(found[0].message.contains("more than 15"), "{found:?}");
}

/// Uniform blocks hold numbers instead of Booleans. The file's Boolean variables are computed from these numbers.
#[test]
fn truth_values_are_uniforms_by_the_names_that_the_file_gives_them() {
    let fragment = "#version 330\nuniform bool on = true;\nuniform bvec2 two;\nout vec4 color;\n\
                    void main() { bool off = !on; color = vec4(off ? 0.0 : 1.0, two.x ? 1.0 : 0.0, 0, 1); }\n";
    let program = compile(VERTEX, fragment).expect("it compiles");
    let members: Vec<_> = program.blocks[1]
        .members
        .iter()
        .map(|member| (member.name.as_str(), member.shape.map(|shape| (shape.scalar, shape.rows)), member.default))
        .collect();
    let expected =
        [("on", Some((Scalar::Uint, 1)), Some([1.0, 0.0, 0.0, 0.0])), ("two", Some((Scalar::Uint, 2)), None)];
    assert_eq!(members, expected);
}

#[test]
fn arrays_that_begin_with_values_are_constants() {
    for values in ["{ 0.5, 1.0, 2.0 }", "float[3](0.5, 1.0, 2.0)", "float[](0.5, 1.0, 2.0)", "{ 0.5, 1.0, 2.0, }"] {
        let fragment = format!(
            "#version 330\nuniform float w[3] = {values};\nout vec4 color;\n\
             void main() {{ color = vec4(0); for (int i = 0; i < w.length(); i++) color.r += w[i]; }}\n"
        );
        let program = compile(VERTEX, &fragment).unwrap_or_else(|faults| panic!("{values}: {faults:?}"));
        assert_eq!(program.fixed.iter().map(|fixed| fixed.name.as_str()).collect::<Vec<_>>(), ["w"]);
        assert_eq!(program.blocks.len(), 1, "no block holds it");
        assert_eq!(&fragment[program.fixed[0].at[0]..program.fixed[0].at[1]], "w");
    }
    let short = "#version 330\nuniform float w[3] = { 0.5 };\nout vec4 color;\nvoid main() { color = vec4(w[1]); }\n";
    assert_eq!(fault(short).0, 2, "too few values");
}

#[test]
fn samplers_that_compare_are_known_and_every_call_of_them_has_its_coordinates() {
    let fragment = "#version 330\nuniform sampler2DShadow s;\nuniform sampler2D t;\nin vec4 p;\nout vec4 color;\n\
                    void main() { color = vec4(texture(s, p.xyz), textureProj(s, p), textureLod(s, p.xyz, 0.0),\n\
                    float(textureSize(s, 0).x)) + texture(t, p.xy) + shadow2D(s, p.xyz) + shadow2DProj(s, p); }\n";
    let vertex =
        "#version 330\nin vec4 position;\nout vec4 p;\nvoid main() { p = position; gl_Position = position; }\n";
    let program = compile(vertex, fragment).expect("it compiles");
    let kinds: Vec<_> = program.samplers.iter().map(|sampler| sampler.kind).collect();
    assert_eq!(kinds, [SamplerKind::Compared, SamplerKind::Color]);
    let wrong = fragment.replace("texture(s, p.xyz)", "texture(s, p.xy)");
    let found = faults(vertex, &wrong);
    assert!(found[0].1 == 6 && found[0].0 == Stage::Fragment, "two coordinates and no depth: {found:?}");
}

/// The depth takes the location after the colours; what the file writes there is dropped.
#[test]
fn the_depth_is_written_behind_the_colours() {
    let depth_only = "#version 330\nout float depth;\nvoid main() { depth = 0.0; }\n";
    let two = "#version 330\nlayout(location = 0) out vec4 a;\nlayout(location = 2) out vec4 b;\nvoid main() { a = b = vec4(1); gl_FragDepth = 0.5; }\n";
    let outputs = |fragment, depth| Source { vertex: VERTEX, fragment, depth }.compile().map(|program| program.outputs);
    assert_eq!(outputs(depth_only, Some(0)), Ok([true, false, false]));
    assert_eq!(outputs("void main() {}", Some(0)), Ok([true, false, false]));
    let old = "#version 120\nvoid main() { gl_FragColor = vec4(1.0); }\n";
    assert_eq!(outputs(old, Some(0)), Ok([true, false, false]), "the depth alone");
    assert_eq!(outputs(old, Some(1)), Ok([true, true, false]));
    assert_eq!(outputs("void main() {}", None), Ok([false; 3]));
    assert_eq!(outputs(two, Some(1)), Ok([true, true, false]));
    assert_eq!(outputs(two, None), Ok([true, false, true]));
}

#[test]
fn functions_may_stand_in_any_order_with_declarations_before() {
    let fragment = "#version 330\nfloat last(float x);\nfloat first(float x) { return last(x) + last(2.0 * x); }\nout vec4 color;\n\
                    void main() { color = vec4(first(1.0)); }\nconst float k = 2.0;\nfloat last(float x) { return k * x; }\n";
    compile(VERTEX, fragment).expect("it compiles");
    let circle = fragment.replace("return k * x;", "return first(x);");
    assert!(compile(VERTEX, &circle).is_err(), "GLSL knows no recursion");
}

#[test]
fn faults_are_where_the_file_has_them() {
    // A tab counts as one column; comments and macros do not move other tokens.
    let body = |statement: &str| {
        format!(
            "#version 330\n// é\n#define TWO 2.0 /* a\n   b */\nout vec4 color;\nvoid main() {{\n\t{statement}\n}}\n"
        )
    };
    compile(VERTEX, &body("color = vec4(TWO);")).expect("it compiles");
    for (statement, column, said) in [
        ("color = vec4(missing);", 15, "missing"),
        ("color = TWO * absent;", 16, "absent"),
        ("float x = 1.0 +;", 17, ""),
        ("color.x = float(gl_PrimitiveID);", 18, "gl_PrimitiveID"),
        ("color = vec4(gl_PointCoord, 0, 0);", 15, "gl_PointCoord"),
    ] {
        let (line, found, message) = fault(&body(statement));
        assert_eq!(line, 7, "{statement}: {message}");
        assert!(
            found.abs_diff(column) <= if said.is_empty() { 20 } else { 0 },
            "{statement}: column {found}: {message}"
        );
        assert!(message.contains(said), "{statement}: {message}");
    }
    // Faults that are found after reading are reported within their function.
    let (line, _, message) = fault(&body("color = vec3(1.0);"));
    assert!((6..=7).contains(&line) && message.contains("main"), "line {line}: {message}");
}

#[test]
fn what_is_not_supported_is_named_with_its_reason() {
    let with = |declaration: &str, read: &str| {
        format!("#version 430\n{declaration}\nout vec4 color;\nvoid main() {{ color = vec4(1.0); {read} }}\n")
    };
    for (declaration, read, said) in [
        ("layout(std430) uniform B { vec4 b; };", "color = b;", "std430"),
        ("layout(std140) buffer B { float b[]; };", "b[0] = color.x;", "cannot lay the buffer `B` out"),
        ("buffer B { vec4 b[]; };\nbuffer C { vec4 c[]; };", "b[0] = c[0];", "a second buffer of binding point 0"),
        ("readonly buffer B { vec4 b[]; };", "b[0] = color;", ""),
        ("buffer float b;", "color.r = b;", "without its block"),
        ("layout(rgba8) uniform image3D i;", "imageStore(i, ivec3(0), color);", "images of this type"),
        ("layout(r32ui) uniform uimage2D i;", "imageAtomicAdd(i, ivec2(0), 1u);", "images of this type"),
        ("uniform image2D i;", "imageStore(j, ivec2(0), color);", "`j` is not an image"),
        ("uniform image2D i[2];", "imageStore(i[int(color.x)], ivec2(0), color);", "`i` is not an image"),
        ("uniform image2D i[17];", "imageStore(i[1], ivec2(0), color);", "valid: 1 to 16"),
        ("uniform sampler2D s[2];", "color = texture(s[2], vec2(0));", "`s` is not a sampler"),
        ("uniform sampler2D s[2];", "color = texture(s[int(color.x)], vec2(0));", "`s` is not a sampler"),
        ("uniform sampler2D s[COUNT];", "color = texture(s[0], vec2(0));", "of a length that is not"),
        ("shared float s;", "s = color.x;", "`shared` is not supported"),
        ("uniform atomic_uint a[2];", "atomicCounterIncrement(a);", "array of atomic counters"),
        ("layout(offset = 2) uniform atomic_uint a;", "atomicCounterIncrement(a);", "at byte 2"),
        ("uniform uint a;", "atomicCounterIncrement(a);", "not a counter"),
        ("uniform samplerCube c;", "color = textureProj(c, vec4(1));", "`textureProj` of a samplerCube"),
        ("uniform samplerCubeArray c;", "color = texture(c, vec4(1));", "samplerCube"),
        ("uniform sampler2D s;", "color = textureCube(s, vec3(1));", "`s` is no samplerCube"),
        ("uniform bool b[2];", "if (b[1]) discard;", "array of truth values"),
        ("uniform sampler2DShadow s;", "color = textureGather(s, vec2(0), 0.5);", "of a sampler2DShadow"),
        ("uniform sampler2D s;", "color = shadow2D(s, vec3(0));", "is a sampler2D"),
        ("uniform float w[2] = float;", "color.r = w[1];", "begins with"),
        ("in vec3 a[9];", "color = vec4(a[0], 1);", "`a` is an array of a kind"),
        ("in mat2x3 a;", "color = vec4(a[0], 1);", "`mat2x3`"),
        ("uniform float w[9];", "color.r = w[3];", "`w` out as `std140`"),
        ("uniform M { vec4 a; vec2 w[2]; };", "color.rg = w[1];", "`w` out as `std140`"),
        (
            "struct S { float a; }; uniform M { S s; float after; };",
            "color.r = s.a + after;",
            "offset 4 must be at least 16",
        ),
        ("struct S { float a; }; uniform M { S s[2]; };", "color.r = s[1].a;", "`s` out as `std140`"),
        ("uniform vec4 v = color0;", "color = v;", "begins with"),
        ("#include \"other.glsl\"", "", "#include"),
        ("#define F(x) x", "color = vec4(F(1.0));", "parameters"),
        ("#extension GL_ARB_bindless_texture : require", "", "GL_ARB_bindless_texture"),
        ("buffer B { sampler2D s[]; };", "color = texture(s[0], vec2(0));", "`s` is of type `sampler2D` in a block"),
        ("layout(location = 3) out vec4 fourth;", "fourth = color;", "location 3"),
        ("uniform vec4 curitiba_x;", "color = curitiba_x;", "reserved"),
        ("layout(location = 0) out vec4 again;", "again = color;", "location 0"),
    ] {
        let text = with(declaration, read).replace("out vec4 color", "layout(location = 0) out vec4 color");
        let found = compile(VERTEX, &text).expect_err(declaration);
        let says = |fault: &Fault| format!("{} {:?}", fault.message, fault.help).contains(said);
        assert!(found.iter().any(says), "{declaration}: {found:?}");
        assert!(found.iter().any(|fault| text[..fault.start].matches('\n').count() >= 1), "{declaration}: {found:?}");
    }
    let attribute = VERTEX
        .replace("in vec4 position;", "in vec4 position; in vec4 bone;")
        .replace("pvm * position", "pvm * position + bone");
    let found = faults(&attribute, FRAGMENT);
    assert_eq!((found[0].1, found[0].2), (3, 27), "{found:?}");
    assert!(found[0].3.contains("no vertex attribute `bone`"), "{found:?}");
    assert!(compile("#version 300 es\nvoid main() {}\n", FRAGMENT).is_err());
    assert!(compile("", "").expect_err("empty").iter().any(|fault| fault.message.contains("no main()")));
}

#[test]
fn buffers_say_whether_they_are_read_and_written_and_counters_are_atomic() {
    let fragment = "#version 430\nstruct ray { vec4 at; vec4 way; };\n\
        layout(std430, binding = 3) buffer Rays { ray rays[]; };\n\
        layout(std430, binding = 1) readonly buffer Hits { vec4 hits[]; } found;\n\
        layout(binding = 2) uniform atomic_uint first;\nlayout(binding = 2) uniform atomic_uint second;\n\
        layout(binding = 7) buffer Unread { vec4 unread[]; };\nout vec4 color;\n\
        void main() { ray r; r.at = found.hits[4]; r.way = vec4(1.0); rays[2] = r;\n\
        uint n = atomicCounterIncrement(second) + atomicCounterDecrement(first) + atomicCounter(first);\n\
        memoryBarrier(); color = vec4(float(n)); }\n";
    let program = compile(VERTEX, fragment).expect("it compiles");
    let of = |buffer: &StorageBuffer| (buffer.point, buffer.held, buffer.read, buffer.written);
    let found: Vec<_> = program.storage.iter().map(of).collect();
    let (block, counters) = (Held::Block, Held::Counters);
    assert_eq!(found, [(3, block, false, true), (1, block, true, false), (2, counters, true, true)]);
    let wgsl = &program.fragment;
    for part in ["array<atomic<u32>>", "atomicAdd(", "atomicSub(", "atomicLoad("] {
        assert_eq!(wgsl.matches(part).count(), 1, "{part}: {wgsl}");
    }
    // The second counter follows the first; counting down returns the number that is left.
    assert!(wgsl.contains("curitiba_up2_(1u)") && wgsl.contains("curitiba_down2_(0u)"), "{wgsl}");
    let vertex = VERTEX.replace("void main", "layout(std430) buffer B { vec4 b[]; };\nvoid main");
    let vertex = vertex.replace("pvm * position", "pvm * (position + b[0])");
    assert!(faults(&vertex, FRAGMENT)[0].3.contains("in a vertex shader"));
}

#[test]
fn images_say_their_units_and_elements_of_arrays_are_images_of_their_own() {
    let fragment = "#version 430\nlayout(binding = 5, rgba8) uniform image2D one;\nwriteonly uniform image2D some[3], unused;\n\
        uniform sampler2D tex[2];\nout vec4 color;\n\
        void main() { imageStore(some[2], imageSize(one), imageLoad(one, ivec2(1))); color = texture(tex[1], vec2(0.5)); }\n";
    let program = compile(VERTEX, fragment).expect("it compiles");
    let images: Vec<_> = program.images().map(|image| (&*image.name, image.point, image.read, image.written)).collect();
    assert_eq!(images, [("one", 5, true, false), ("some[2]", 0, false, true)]);
    assert_eq!(program.samplers.iter().map(|sampler| &*sampler.name).collect::<Vec<_>>(), ["tex[1]"]);
    // The sizes of both images are uniforms.
    let members = program.blocks.iter().flat_map(|block| &block.members);
    let sizes: Vec<_> = members.filter_map(|member| is_image_size(&member.name)).collect();
    assert_eq!(sizes, [0, 1]);
}

#[test]
fn compute_shaders_have_the_work_groups_that_they_declare() {
    let text = "#version 430\n#define SIDE 4\nlayout(local_size_x = SIDE, local_size_y = 2) in;\n\
        shared float sums[SIDE * 2];\nuniform writeonly image2D made;\nuniform float level = 0.5;\n\
        void main() { sums[gl_LocalInvocationIndex] = level; barrier();\n\
        imageStore(made, ivec2(gl_GlobalInvocationID.xy), vec4(sums[0])); }\n";
    let program = ComputeSource { text }.compile().expect("it compiles");
    let compute = program.compute.as_ref().expect("a compute shader");
    assert_eq!(compute.group, [4, 2, 1]);
    assert!(
        compute.text.contains("@workgroup_size(4, 2, 1)") && compute.text.contains("workgroupBarrier()"),
        "{compute:?}"
    );
    assert!(program.vertex.is_empty() && program.fragment.is_empty() && program.attributes.is_empty());
    assert!(program.blocks.iter().all(|block| block.stage == Stage::Compute));
    let faults = ComputeSource { text: &text.replace("made, ivec2", "made, vec2") }.compile().expect_err("refused");
    assert!(faults.iter().all(|fault| fault.stage == Stage::Compute), "{faults:?}");
    assert!(faults.iter().any(|fault| text[..fault.start].matches('\n').count() == 7), "{faults:?}");
}

/// Files with which the preprocessor or the compiler would run for long or recurse until the stack overflows, and broken files.
#[test]
fn hostile_files_are_refused_soon() {
    let main = |inside: String| format!("#version 330\nout vec4 color;\nvoid main() {{ {inside} }}\n");
    let bombs: String = (0..40).map(|level| format!("#define m{} m{level} m{level}\n", level + 1)).collect();
    let deep = |open: &str, close: &str, count: usize| format!("{}1.0{}", open.repeat(count), close.repeat(count));
    for text in [
        format!("#define m0 1.0 +\n{bombs}{}", main("color = vec4(m40 1.0);".to_owned())),
        main(format!("color = vec4({});", deep("(", ")", 5_000))),
        main(format!("color = vec4({}1.0);", "- ".repeat(50_000))),
        main("if (true) {".repeat(5_000) + &"}".repeat(5_000)),
        main("if (color.x > 0.0) discard; else ".repeat(5_000) + ";"),
        format!("#if {}\n#endif\n{}", "(".repeat(100_000), FRAGMENT),
        "/*".to_owned(),
        "#version 330\nvoid main() { color = 1e99; }".to_owned(),
        "#version 330\nuniform".to_owned(),
        "#version 330\nout vec4".to_owned(),
        "layout(".to_owned(),
        "in Data {".to_owned(),
        "\u{0}\u{7f}é".to_owned(),
    ] {
        assert!(compile(VERTEX, &text).is_err(), "{}", &text[..text.len().min(60)]);
    }
    // Files just within the limits do not overflow the stack.
    compile(VERTEX, &main(format!("color = vec4({});", deep("(", ")", 40)))).expect("it compiles");
    compile(VERTEX, &main(format!("color = vec4({}1.0);", "- ".repeat(1_900)))).expect("it compiles");
    let chain = |links: usize| {
        let links = "if (color.x > 0.0) color.y = 1.0; else ".repeat(links);
        compile(VERTEX, &main(format!("color = vec4(1.0); {links} color.z = 1.0;")))
    };
    chain(100).expect("it compiles");
    // In WGSL each link of the chain is nested in the braces of the one before, and the device's parser limits nesting.
    let faults = chain(900).expect_err("refused");
    assert!(faults[0].message.contains("nesting limit"), "{faults:?}");
}

#[test]
fn a_panic_of_the_compiler_is_an_error() {
    // The panic is planted on the thread that compiles.
    let planted = |name: &'static str| {
        let text = tokens::tokens(Stage::Fragment, FRAGMENT).expect("tokens");
        match name {
            "pp-rs" => guard::plant::in_crate(name, || tokens::tokens(Stage::Fragment, FRAGMENT).expect_err("refused")),
            _ => {
                let stated = rewrite::read(Stage::Fragment, &text, 0).expect("read");
                let vertex = tokens::tokens(Stage::Vertex, VERTEX).expect("tokens");
                let vertex = rewrite::read(Stage::Vertex, &vertex, 0).expect("read");
                let linked = link::link(&vertex, &stated, None).expect("linked");
                guard::plant::in_crate(name, || {
                    let translated = translate::translate(Stage::Fragment, &linked.fragment, &stated);
                    translated.expect_err("refused").remove(0)
                })
            }
        }
    };
    for name in ["pp-rs", "naga"] {
        let fault = planted(name);
        assert!(fault.message.contains(name) && fault.message.contains("planted"), "{fault:?}");
    }
}
