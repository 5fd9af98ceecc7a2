// A step whose tasks come and go: the results of the active sets, and their mean.
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <hsp/indices.hpp>
#include <hsp/kind.hpp>

namespace hsp {

struct ChooseSets {
  static constexpr const char* doc =
      "Which sets of parts a step resolves, and their shares: (1 - w₁), (w₁ - w₂), ... with the "
      "presences w₁ ≥ w₂ ≥ ... between 0 and 1. Whether all of them are there; if not, none is on.";
  In<'k'> presences;
  Ints<'s', 'k'> members;  // 1: the set has this part
  OutInts<'s'> on;
  Out<'s'> shares;
  static constexpr Index most = 64;

  void check() const {
    if (presences.size() > most) throw std::invalid_argument("there may be 64 parts");
  }
  bool operator()() {
    std::array<Index, most> coming;
    Index count = 0;
    std::uint64_t set = 0;
    for (Index k = 0; k < presences.size(); ++k) {
      const double w = presences[k];
      if (w >= 1.0) set |= bit(k);
      else if (w > 0.0) {  // after those of the same presence
        Index place = count++;
        for (; place > 0 && presences[coming[place - 1]] < w; --place)
          coming[place] = coming[place - 1];
        coming[place] = k;
      }
    }
    on.setZero();
    shares.setZero();
    bool all = true;
    double share = 1.0;
    for (Index i = 0; i <= count; ++i) {
      const double next = i < count ? presences[coming[i]] : 0.0;
      if (share != next) {
        const Index s = place_of(set);
        all = all && s < on.size();
        if (s < on.size()) {
          on[s] = 1;
          shares[s] = share - next;
        }
      }
      share = next;
      if (i < count) set |= bit(coming[i]);
    }
    if (!all) {
      on.setZero();
      shares.setZero();
    }
    return all;
  }

 private:
  static std::uint64_t bit(Index k) { return std::uint64_t{1} << k; }

  // Which of the sets has these parts; their number: none.
  Index place_of(std::uint64_t set) const {
    for (Index s = 0; s < on.size(); ++s) {
      std::uint64_t own = 0;
      for (Index k = 0; k < presences.size(); ++k)
        if (members(s, k)) own |= bit(k);
      if (own == set) return s;
    }
    return on.size();
  }
};

struct KeepLevel {
  static constexpr const char* doc = "Keep the first level with a bounded inverse of one set.";
  Ints<1> level;
  OutInts<1> kept;

  void operator()() { kept = level; }
};

struct MixSets {
  static constexpr const char* doc =
      "The weighted mean of the efforts of sets, which not even by rounding leaves their range, "
      "with the worst status; the last one stays where one has nothing. Whether there is one.";
  Ints<'s'> on;
  In<'s'> shares;
  In<'s', 'n'> accelerations, efforts;
  Ints<'s'> statuses, finite, levels;
  Out<'n'> a, tau;
  OutInts<1> status, delivered, damped_level;  // of the set with the fewest tasks that is damped

  bool operator()() {
    damped_level[0] = 0;
    delivered[0] = 1;
    for (Index s = 0; s < on.size(); ++s) {
      if (!on[s]) continue;
      if (!finite[s]) delivered[0] = 0;
      if (damped_level[0] == 0) damped_level[0] = levels[s];
    }
    if (!delivered[0]) return false;
    status[0] = 0;
    for (Index s = 0; s < on.size(); ++s)
      if (on[s]) status[0] = std::max(status[0], statuses[s]);
    mix(accelerations, a);
    mix(efforts, tau);
    return true;
  }

 private:
  template <class Parts, class Mean> void mix(const Parts& parts, Mean& mean) const {
    for (Index i = 0; i < mean.size(); ++i) {
      double sum = 0.0, least = 0.0, most = 0.0;
      bool first = true;
      for (Index s = 0; s < on.size(); ++s) {
        if (!on[s]) continue;
        const double x = parts(s, i), share = shares[s] * x;
        sum = first ? share : sum + share;
        least = first ? x : std::min(least, x);
        most = first ? x : std::max(most, x);
        first = false;
      }
      mean[i] = std::clamp(sum, least, most);
    }
  }
};

}  // namespace hsp
