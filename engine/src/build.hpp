// What the engine was built as: plans that are saved run with the same, and give the same bits.
#pragma once

namespace hsp {

// Such as "hsp_control 0.3.0, x86_64, 8-byte pointers, little-endian, SSE2".
const char* build_text();

}  // namespace hsp
