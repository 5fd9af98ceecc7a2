// A step whose tasks come and go: the results of the active sets, and their mean.
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <hsp/indices.hpp>
#include <hsp/kind.hpp>

namespace hsp {

struct ChooseSets {
  static constexpr const char* doc =
      "Which sets of parts a step resolves, and their shares: a part is active in its interval of "
      "(0, 1), and a set's share is the length of where these parts are. Whether all of the sets are "
      "there; if not, none is on.";
  In<'k'> lows, highs;     // the intervals, empty where high <= low
  Ints<'s', 'k'> members;  // 1: the set has this part
  OutInts<'s'> on;
  Out<'s'> shares;
  static constexpr Index most = 64;
  static constexpr double least = 1e-12;  // what is shorter is rounding; as in mixture.py

  void check() const {
    if (highs.size() > most) throw std::invalid_argument("there may be 64 parts");
  }
  bool operator()() {
    std::array<double, 2 * most + 2> ends{0.0, 1.0};
    Index count = 2;
    for (Index k = 0; k < highs.size(); ++k) {
      if (highs[k] <= lows[k]) continue;
      for (const double end : {lows[k], highs[k]})
        if (0.0 < end && end < 1.0) ends[count++] = end;
    }
    std::sort(ends.begin(), ends.begin() + count, std::greater<>());
    on.setZero();
    shares.setZero();
    for (Index i = 0; i + 1 < count; ++i) {
      const double high = ends[i], low = ends[i + 1];
      if (high - low < least) continue;
      const Index s = place_of(active(low, high));
      if (s == on.size()) {
        on.setZero();
        shares.setZero();
        return false;
      }
      on[s] = 1;
      shares[s] += high - low;
    }
    return true;
  }

 private:
  static std::uint64_t bit(Index k) { return std::uint64_t{1} << k; }

  // The parts that are active between two ends.
  std::uint64_t active(double low, double high) const {
    std::uint64_t set = 0;
    for (Index k = 0; k < highs.size(); ++k)
      if (lows[k] <= low && high <= highs[k]) set |= bit(k);
    return set;
  }

  // Which of the sets has these parts; their number: none.
  Index place_of(std::uint64_t set) const {
    for (Index s = 0; s < on.size(); ++s) {
      std::uint64_t own = 0;
      for (Index k = 0; k < highs.size(); ++k)
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
