// Notes where the driver has left a loop before its end: from then on it leaves each loop after one step.
fn note_cut_loops() {
    var steps = 0u;
    while steps < 2u + params.zero { steps += 1u; }
    if steps < 2u { atomicStore(&ray_counts[CUT_LOOPS], 1u); }
}

