#pragma once

#include <optional>

#include "sim/cut/cut.h"

namespace abbe::sim {

/// A program as it was cut, to be filmed; what it refers to outlives the film.
struct FilmedCut {
  const Job& job;
  const Commands& commands;
  const Process& process;  ///< of [cutting], with its stock; else empty
  /// When vertices of the design were cut; null with [cutting].
  const cutting::Surface* surface = nullptr;
};

struct FilmOptions {
  int width = 1280;  ///< px
  int height = 720;  ///< px
  /// Of the errors of the tool and its path; 1: the path is not drawn; none: a round one, by which
  /// the largest is about a twentieth of the part.
  std::optional<double> magnification = 1.0;
};

}  // namespace abbe::sim
