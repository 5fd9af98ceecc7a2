#include "../src/rooms.hpp"
#include "along.hpp"
#include "blends.hpp"
#include "charts.hpp"
#include "curves.hpp"
#include "extrapolations.hpp"
#include "poses.hpp"

namespace hsp {
const Kind* const* trajectory_kinds() {
  return kinds<Circle, Lissajous, UniformLine, Polynomial, PiecewisePolynomial, Blend, Crossfade,
               CrossfadeOfStreams, OrientationPath, Spin, BlendOrientation, OffsetCoefficients,
               CrossfadeOrientation, CrossfadeOrientationOfStreams, Screw, OrientationOfChart,
               Extrapolation, ExtrapolatedOrientation, Along, AlongOrientation, AlongPose>();
}
}  // namespace hsp
