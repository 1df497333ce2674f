// Parameters of the passes that sum the samples of a light.

struct GatherParams {
    strata: u32,
    words: u32,         // of visibility a receiver; 0: everything is seen
    light: u32,
    pad: u32,
}
