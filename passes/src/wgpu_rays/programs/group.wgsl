// Votes among the 32 threads of a group, which need not run in lockstep.

const GROUP: u32 = 32u;
var<private> lane: u32;
// Three rounds of four words: one is being written, one may still be read, one is 0.
var<workgroup> votes: array<atomic<u32>, 12>;
var<private> next_vote: u32 = 0u;

fn begin_group(thread: u32) {
    lane = thread;
    if lane < 12u { atomicStore(&votes[lane], 0u); }
    workgroupBarrier();
}
fn end_vote() {
    if lane < 4u { atomicStore(&votes[4u * ((next_vote + 2u) % 3u) + lane], 0u); }
    next_vote = (next_vote + 1u) % 3u;
}
// Mask of the threads whose value is true. All threads must call it.
fn ballot(value: bool) -> u32 {
    let first = 4u * next_vote;
    if value { atomicOr(&votes[first], 1u << lane); }
    workgroupBarrier();
    let bits = atomicLoad(&votes[first]);
    end_vote();
    return bits;
}
// Masks for four values. After the call, earlier writes of threads to shared memory are visible.
fn ballots(values: vec4<bool>) -> vec4u {
    let first = 4u * next_vote;
    if values.x { atomicOr(&votes[first], 1u << lane); }
    if values.y { atomicOr(&votes[first + 1u], 1u << lane); }
    if values.z { atomicOr(&votes[first + 2u], 1u << lane); }
    if values.w { atomicOr(&votes[first + 3u], 1u << lane); }
    workgroupBarrier();
    let bits = vec4u(
        atomicLoad(&votes[first]), atomicLoad(&votes[first + 1u]), atomicLoad(&votes[first + 2u]), atomicLoad(&votes[first + 3u]));
    end_vote();
    return bits;
}
fn before(bits: u32) -> u32 { return countOneBits(bits & ((1u << lane) - 1u)); }
