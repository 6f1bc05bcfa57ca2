//! The encodings of COLLADA and Ogre files.

use crate::scene_support::{Folder, load_one};
use curitiba_pipeline::scene::{LoadOptions, Scene, load};

/// A triangle whose name has a letter outside ASCII.
fn dae(encoding: &str) -> String {
    format!(
        r##"<?xml version="1.0" encoding="{encoding}"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<library_geometries><geometry id="g" name="casa café"><mesh>
<source id="p"><float_array id="pa" count="9">0 0 0  1 0 0  0 1 0</float_array><technique_common>
<accessor source="#pa" count="3" stride="3"/></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles></mesh></geometry></library_geometries>
</COLLADA>"##
    )
}

/// Encodes a text in Latin-1, where each letter is the byte of its code point.
fn in_bytes(text: &str) -> Vec<u8> {
    text.chars().map(|letter| u8::try_from(letter).expect("Latin-1")).collect()
}

fn loaded(file: &str, bytes: &[u8]) -> Result<Scene, String> {
    let folder = Folder::new();
    load_one(&folder.write(file, bytes)).map_err(|error| error.to_string())
}

fn named(bytes: &[u8]) -> Result<String, String> {
    loaded("house.dae", bytes).map(|scene| scene.meshes[0].name.clone())
}

#[test]
fn the_xml_declaration_says_how_the_text_is_encoded() {
    let expected = Ok("casa café".to_owned());
    for name in ["ISO-8859-1", "windows-1252", "iso-8859-15", "Latin1"] {
        assert_eq!(named(&in_bytes(&dae(name))), expected, "{name}");
    }
    let single = dae("X").replacen("encoding=\"X\"", "encoding = 'ISO-8859-1'", 1);
    assert_eq!(named(&in_bytes(&single)), expected);
    // Windows-1252 has the euro sign where ISO-8859-1 has a control character.
    let mut euro = in_bytes(&dae("windows-1252"));
    let at = euro.iter().position(|byte| *byte == 0xe9).expect("the letter");
    euro[at] = 0x80;
    assert_eq!(named(&euro), Ok("casa caf€".to_owned()));
    // A byte order mark has precedence over the declaration. A text that declares UTF-16 but has one byte per letter is UTF-8.
    let wide = dae("utf-8");
    let wide: Vec<u8> = "\u{feff}".encode_utf16().chain(wide.encode_utf16()).flat_map(u16::to_le_bytes).collect();
    assert_eq!(named(&wide), expected);
    assert_eq!(named(dae("utf-16").as_bytes()), expected);
    assert_eq!(named(dae("UTF-8").as_bytes()), expected);
    assert_eq!(named(format!("\u{feff}{}", dae("UTF-8")).as_bytes()), expected);
}

#[test]
fn text_in_another_encoding_than_the_file_says_is_refused_with_its_place() {
    let refused = |bytes: &[u8]| named(bytes).expect_err("it is refused");
    let unknown = refused(dae("KLINGON-8").as_bytes());
    assert!(unknown.contains("`KLINGON-8` is no encoding that is known"), "{unknown}");
    let latin = refused(&in_bytes(&dae("UTF-8")));
    assert!(latin.contains("this is not UTF-8") && latin.contains("house.dae:3:"), "{latin}");
    let japanese = refused(&[dae("Shift_JIS").into_bytes(), vec![0xfd]].concat());
    assert!(japanese.contains("this is not Shift_JIS, as the file says"), "{japanese}");
    // Line numbers in messages are those of the file, whatever its encoding.
    let wrong = refused(&in_bytes(&dae("ISO-8859-1").replacen(">0 0 0", ">0 zero 0", 1)));
    assert!(wrong.contains("house.dae:4:") && wrong.contains("`zero`"), "{wrong}");
}

/// The text is held in UTF-8 beside the file's bytes, and takes up to three bytes for each of them.
#[test]
fn the_text_counts_as_memory() {
    let folder = Folder::new();
    let text = in_bytes(&dae("ISO-8859-1"));
    let options = LoadOptions { max_bytes: 2 * text.len() as u64, ..LoadOptions::default() };
    let path = folder.write("house.dae", text);
    let error = load(&[path], &options, &|_| {}).expect_err("there is no room").to_string();
    assert!(error.contains("the text"), "{error}");
}

#[test]
fn ogre_files_have_encodings_too() {
    let mesh = |encoding: &str| {
        format!(
            r#"<?xml version="1.0" encoding="{encoding}"?>
<mesh><sharedgeometry vertexcount="3"><vertexbuffer positions="true">
<vertex><position x="0" y="0" z="0"/></vertex><vertex><position x="1" y="0" z="0"/></vertex><vertex><position x="0" y="1" z="0"/></vertex>
</vertexbuffer></sharedgeometry><submeshes><submesh material="café" usesharedvertices="true" operationtype="triangle_list">
<faces count="1"><face v1="0" v2="1" v3="2"/></faces></submesh></submeshes></mesh>"#
        )
    };
    for bytes in [in_bytes(&mesh("ISO-8859-1")), mesh("UTF-8").into_bytes()] {
        let scene = loaded("house.mesh.xml", &bytes).expect("it loads");
        assert!(scene.materials.iter().any(|material| material.name == "café"), "{:?}", scene.materials);
    }
    assert!(
        loaded("house.mesh.xml", &in_bytes(&mesh("UTF-8"))).expect_err("it is refused").contains("this is not UTF-8")
    );
}
