// The build of the engine: saved plans require the same build, and give the same bits.
#pragma once

namespace hsp {

// Such as "hsp_control 0.3.0, x86_64, 8-byte pointers, little-endian, SSE2".
const char* build_text();

}  // namespace hsp
