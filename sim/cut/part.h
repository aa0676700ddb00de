#pragma once

#include <string>

#include "cutting/mesh.h"
#include "sim/machine/machine.h"
#include "sim/program/generate.h"
#include "sim/program/path.h"
#include "sim/scene/scene.h"

namespace abbe::sim {

/// The design of a scene, loaded.
struct Part {
  cutting::Design design_m;       ///< in the part's own frame
  cutting::Design design_w;       ///< in the workpiece frame, where it is cut
  program::ContactField contact;  ///< part frame, continued beyond the rim where a raster asks
  Eigen::Vector2d lower, upper;   ///< mm, x y of the part frame that a raster covers
};

/// @throws BadInput, also if a mesh seems to be in another unit than the scene says, or no vertex
///         is left to be judged
Part load_part(const Scene& scene);

/// A program read, and its text if a generator wrote it.
struct Program {
  program::Path path;
  std::string text;
  program::Unreached unreached;  ///< what a generator had to leave out
};

/// Reads the program of a scene; a generated one is read back from its own text, under the name
/// that its file will have.
/// @throws BadInput
Program load_program(const Scene& scene, const Machine& machine, const Part& part);

/// What the control of the scene knows before it reads a program.
program::NcOptions nc_options(const Scene& scene, const Machine& machine);

}  // namespace abbe::sim
