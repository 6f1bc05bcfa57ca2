//! Spreads a scene's arrays over bindings: an array larger than a device's limit for one binding is bound in several
//! parts.

use std::fmt::Write as _;

/// The arrays of group 1, in the order of their bindings: name, element type, and contents.
const ARRAYS: [(&str, &str, &str); 5] = [
    ("nodes", "vec4u", "Four vectors a node: see `trace/build/gpu_binary.rs`."),
    ("leaves", "vec4u", "Three vectors a triangle of a leaf: its corners; in the first one's fourth place the id."),
    ("vertices", "u32", "Positions, normals, texture coordinates, colours and tangents, as bits of numbers."),
    ("mesh", "u32", "Corners of the triangles, then their materials."),
    ("texels", "u32", "Red in the lowest byte."),
];

/// The number of bindings of each array.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Split {
    /// By array; at least 1.
    pub bindings: [u32; 5],
    /// Size in bytes of each binding of an array with several bindings, except the array's last one: a power of two. 0 if no array has several
    /// bindings.
    pub bytes: u64,
}

impl Default for Split {
    fn default() -> Self {
        Self { bindings: [1; 5], bytes: 0 }
    }
}

impl Split {
    /// The split for arrays of these sizes in bytes, on a device that binds at most `most` bytes at once (16 or more).
    pub fn new(sizes: [u64; 5], most: u64) -> Self {
        let part = 1 << most.max(16).ilog2();
        let bindings = sizes.map(|bytes| if bytes <= most { 1 } else { bytes.div_ceil(part) as u32 });
        Self { bindings, bytes: if bindings == [1; 5] { 0 } else { part } }
    }

    /// Total number of bindings.
    pub fn count(self) -> u32 {
        self.bindings.iter().sum()
    }

    /// The parts of an array, in the order of their bindings.
    pub fn parts(self, array: usize, bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
        let whole = self.bindings[array] == 1;
        let length = if whole { bytes.len().max(1) } else { self.bytes as usize };
        // An empty array has one binding, too.
        let empty = bytes.is_empty().then_some(bytes);
        bytes.chunks(length).chain(empty)
    }

    /// WGSL declarations of the arrays, and of functions that read them: `nodes_at` and so on.
    pub fn text(self) -> String {
        let mut text = String::new();
        let mut binding = 0;
        for ((name, element, what), count) in ARRAYS.into_iter().zip(self.bindings) {
            // Writing to a String cannot fail.
            let mut line = |line: String| _ = writeln!(text, "{line}");
            line(format!("// {what}"));
            let mut declare = |name: &str| {
                line(format!("@group(1) @binding({binding}) var<storage, read> {name}: array<{element}>;"));
                binding += 1;
            };
            if count == 1 {
                declare(name);
                line(format!("fn {name}_at(place: u32) -> {element} {{ return {name}[place]; }}"));
                continue;
            }
            (0..count).for_each(|part| declare(&format!("{name}_{part}")));
            let elements = self.bytes / if element == "u32" { 4 } else { 16 };
            line(format!("fn {name}_at(place: u32) -> {element} {{"));
            line(format!("    let part = place >> {}u; let rest = place & {}u;", elements.ilog2(), elements - 1));
            for part in 0..count - 1 {
                line(format!("    if part == {part}u {{ return {name}_{part}[rest]; }}"));
            }
            line(format!("    return {name}_{}[rest];\n}}", count - 1));
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_that_fit_have_one_binding_and_others_parts_of_a_power_of_two() {
        assert_eq!(Split::new([100, 5, 0, 64, 1], 100), Split::default());
        let split = Split::new([101, 64, 0, 128, 129], 100);
        assert_eq!((split.bindings, split.bytes, split.count()), ([2, 1, 1, 2, 3], 64, 9));
        let bytes: Vec<u8> = (0..129).collect();
        let parts: Vec<&[u8]> = split.parts(4, &bytes).collect();
        assert_eq!((parts.len(), parts.concat() == bytes), (3, true));
        assert_eq!(split.parts(2, &[]).count(), 1, "an empty array is bound");
        assert_eq!(split.parts(1, &bytes[..64]).count(), 1);
        // A limit that is not a power of two: bindings use the next lower power.
        assert_eq!(Split::new([(1 << 32) - 1, 1 << 32, 0, 0, 0], (1 << 32) - 1).bindings, [1, 2, 1, 1, 1]);
    }
}
