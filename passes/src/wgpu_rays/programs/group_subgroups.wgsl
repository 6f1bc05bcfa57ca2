// Votes among the 32 threads of a group that is one subgroup.

const GROUP: u32 = 32u;
var<private> lane: u32;

fn begin_group(thread: u32) { lane = subgroupExclusiveAdd(1u); }
// Mask of the threads whose value is true. All threads must call it.
fn ballot(value: bool) -> u32 { return subgroupBallot(value).x; }
// Masks for four values. After the call, earlier writes of threads to shared memory are visible.
fn ballots(values: vec4<bool>) -> vec4u {
    workgroupBarrier();
    return vec4u(ballot(values.x), ballot(values.y), ballot(values.z), ballot(values.w));
}
fn before(bits: u32) -> u32 { return countOneBits(bits & ((1u << lane) - 1u)); }
