#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "cutting/alignment.h"
#include "cutting/form.h"
#include "cutting/residual.h"
#include "sim/cut/cut.h"

namespace abbe::sim {

/// One case judged: its map aligned as the scene asks, and the figures of it.
struct Verdict {
  Cut cut;
  cutting::Aligned aligned;      ///< the map without what the alignment of the scene takes out
  cutting::Statistics residual;  ///< of the aligned map
  std::vector<cutting::FormNumber> form;       ///< where the design is a known surface
  std::optional<cutting::Statistics> machine;  ///< of it minus the error-free map
  /// A ring of the part, and its mean radius, mm; none where nothing of it is cut.
  struct Ring {
    std::string name;
    std::optional<double> radius;
  };
  std::vector<Ring> rings;
};

/// @param error_free  the map that is taken away for the machine's own part; null for that case
///                    itself
Verdict judge(const Job& job, Cut cut, const Verdict* error_free);

/// Names the acceptance limits of the scene that a case exceeds; empty if none.
std::vector<std::string> exceeded(const Limits& limits, const Verdict& verdict);

/// A case beside others.
struct Compared {
  Verdict verdict;
  const Job* job = nullptr;  ///< the scene itself, or the variant, that it belongs to
  std::optional<std::size_t> uncompensated;  ///< index of the case that it is measured against
};

/// Names as they stand in files and pictures.
const char* name_of(DatumDescription::Kind datum);
const char* name_of(Alignment alignment);

}  // namespace abbe::sim
