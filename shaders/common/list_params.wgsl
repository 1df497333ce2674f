// Parameters of the passes that work on lists of tiles and cells, for one light.

struct ListParams {
    width: u32,         // internal columns
    height: u32,
    light: u32,
    patterns: u32,      // sets of sample points
    seed: u32,
    first: u32,         // entry of the list at which this piece begins
    blocks_u: u32,      // blocks of strata along edge u; 16 / blocks_u along edge v
    reuse: u32,         // what neighbours agree on is not asked again: 0 never, 1 carefully, 2 thriftily
    boosts: u32,        // two bits a block of strata: 0 dim, 1 as most, 2 bright
    pad0: u32,
    pad1: u32,
    pad2: u32,
}
