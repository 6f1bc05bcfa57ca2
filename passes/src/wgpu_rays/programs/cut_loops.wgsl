// Records whether the driver has left a loop before its end. Once it has, it leaves every loop after one step, which this loop detects.
fn note_cut_loops() {
    var steps = 0u;
    while steps < 2u + params.zero { steps += 1u; }
    if steps < 2u { atomicStore(&ray_counts[CUT_LOOPS], 1u); }
}

