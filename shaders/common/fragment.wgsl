// Fragments: what a texel and a pixel say of them. The codes of levels and reasons are those of src/frame.rs.

// Bits of texel_state. Any of the first three: some pixel sees a surface.
const LIT: u32 = 1u;            // some pixel may receive light
const FACES_AWAY: u32 = 2u;     // some pixel receives none, and at least one light shines its way
const LIES_BEHIND: u32 = 4u;    // some pixel lies behind every light
const ROUGH_DEPTH: u32 = 8u;    // the depth metric refuses the texel
const ROUGH_NORMAL: u32 = 16u;  // the normal metric does
const OUTSIDE_LOBE: u32 = 128u; // some pixel shows no light in its lobe
const ROUGH_LOBE: u32 = 256u;   // wider than the lobe
const ON_SURFACE: u32 = 135u;
const ROUGH: u32 = 280u;

const LEVEL_CULLED: u32 = 254u;
const LEVEL_NOTHING: u32 = 255u;
const REASON_COARSEST: u32 = 0u;
const REASON_DEPTH: u32 = 1u;
const REASON_NORMAL: u32 = 2u;
const REASON_ILLUMINATION: u32 = 3u;
const REASON_VISIBILITY: u32 = 4u;
const REASON_LOBE: u32 = 5u;
const REASON_EMITTER: u32 = 6u;
const REASON_FACING_AWAY: u32 = 7u;
const REASON_BEHIND_LIGHT: u32 = 8u;
const REASON_OUTSIDE_LOBE: u32 = 9u;
const REASON_NOTHING: u32 = 255u;

// fragment_flags, a word a place of the tile order: at the first pixel of a fragment its level + 1 and this bit.
const FRAGMENT: u32 = 256u;

// fragment_at, a word a texel: 0 no fragment, 1 + its number in the list, or
const CULLED: u32 = 0xffffffffu;
