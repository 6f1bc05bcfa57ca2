//! The nodes of the tree in the layout of the kernels.

use bytemuck::{Pod, Zeroable};
use curitiba_passes::trace::gpu_tree::DeviceNode;

/// Number of children of a node.
const CHILDREN: usize = 8;

/// A node of eight children: 128 bytes, one cache line.
///
/// As [`DeviceNode`], except that quantised planes are 16-bit floats here: a kernel converts half a register to an `f32` in one
/// instruction, on a pipe with spare capacity. Bytes would have to be extracted first, on the pipe that limits traversal. All 256 values
/// of a byte are exact as 16-bit floats.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C, align(16))]
pub(crate) struct WideNode {
    /// The part of [`DeviceNode`] before the planes: corner, exponents, inner slots, first child, first triangle and children.
    head: [u32; 8],
    /// Low and high planes of the children by axis, as 16-bit floats.
    planes: [[[u16; CHILDREN]; 2]; 3],
}

impl From<&DeviceNode> for WideNode {
    fn from(node: &DeviceNode) -> Self {
        let [low, high] = [&node.low, &node.high].map(|planes| planes.map(|axis| axis.map(half)));
        let words = bytemuck::bytes_of(node);
        let head = bytemuck::pod_read_unaligned(&words[..32]);
        Self { head, planes: [0, 1, 2].map(|axis| [low[axis], high[axis]]) }
    }
}

/// A byte as a 16-bit float (IEEE 754 binary16), exactly.
fn half(byte: u8) -> u16 {
    match byte.checked_ilog2() {
        None => 0,
        Some(exponent) => ((15 + exponent as u16) << 10) | ((u16::from(byte) << (10 - exponent)) & 0x3ff),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_byte_is_exact_as_a_half() {
        for byte in 0..=u8::MAX {
            let bits = half(byte);
            let (exponent, fraction) = (i32::from(bits >> 10), f64::from(bits & 0x3ff));
            let value =
                if exponent == 0 { fraction } else { (1.0 + fraction / 1024.0) * f64::from(exponent - 15).exp2() };
            assert_eq!(value, f64::from(byte), "{bits:04x}");
        }
    }

    #[test]
    fn a_wide_node_has_the_head_and_the_planes_of_a_node() {
        let mut node = DeviceNode::zeroed();
        node.corner = [1.0, 2.0, 3.0];
        node.exponents = [1, 2, 3];
        node.inner = 0x80;
        (node.first_child, node.first_triangle) = (5, 6);
        node.children = [1, 2, 3, 4, 5, 6, 7, 8];
        node.low[1][3] = 3;
        node.high[2][7] = 255;
        let wide = WideNode::from(&node);
        assert_eq!(size_of::<WideNode>(), 128);
        assert_eq!(wide.head[..3], [1.0_f32, 2.0, 3.0].map(f32::to_bits));
        assert_eq!(wide.head[3..], [0x8003_0201, 5, 6, 0x0403_0201, 0x0807_0605]);
        let mut planes = [[[0; CHILDREN]; 2]; 3];
        planes[1][0][3] = half(3);
        planes[2][1][7] = half(255);
        assert_eq!(wide.planes, planes);
    }
}
