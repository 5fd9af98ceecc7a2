#include "../src/rooms.hpp"
#include "contact_wrenches.hpp"
#include "dry_friction.hpp"
#include "limit_excess.hpp"
#include "periods.hpp"

namespace hsp {
const Kind* const* simulation_kinds() {
  return kinds<Periods, LimitExcess, DryFriction, AddContactWrenches>();
}
}  // namespace hsp
