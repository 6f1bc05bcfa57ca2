// What the 32 threads of a group find together, where they are one subgroup.

const GROUP: u32 = 32u;
var<private> lane: u32;

fn begin_group(thread: u32) { lane = subgroupExclusiveAdd(1u); }
// One bit for each thread whose value is true. All threads call it.
fn ballot(value: bool) -> u32 { return subgroupBallot(value).x; }
// The same of four values. What they wrote to shared memory before is there after it.
fn ballots(values: vec4<bool>) -> vec4u {
    workgroupBarrier();
    return vec4u(ballot(values.x), ballot(values.y), ballot(values.z), ballot(values.w));
}
fn before(bits: u32) -> u32 { return countOneBits(bits & ((1u << lane) - 1u)); }
