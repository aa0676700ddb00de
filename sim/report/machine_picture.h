#pragma once

#include "render/machine_picture.h"
#include "sim/cut/cut.h"
#include "sim/cut/program_inspection.h"

namespace abbe::sim {

/// Returns the picture of `abbe check --picture`: machine, fixtures, part and path. The axes are at
/// the middle sample of the program. If the machine's description has no bodies, the carriages are
/// simple bodies, stacked from the tool and from the part towards the bed below them. The nominal
/// path and the actual one with magnified errors are drawn; of a long path only segments.
render::MachinePicture machine_picture(const Job& job);

/// Returns the picture of `abbe program --picture`: the machine with its axes at home, and the feed
/// moves and rapids of a program.
render::MachinePicture machine_picture(const ProgramInspection& inspection);

/// Returns a round factor that magnifies the largest error of a path, mm, to about a twentieth of
/// the part; 1 if the error is large enough already, or zero.
double round_magnification(double part_size, double largest_error);

/// A simple body of a machine without bodies of its own, with the axes at zero.
struct SchematicBody {
  render::Body body;  ///< in the frame of its carrier
  int frame = 0;      ///< index of the carrier, `Carriers::carriage` or the bed
};

/// Returns the simple carriages and the spindle of a machine whose description has no bodies.
/// Unlike the picture, they have no connecting bars, whose lengths would change with the axis
/// positions.
/// @param design_w  the part, which sets their size
std::vector<SchematicBody> schematic_bodies(const Machine& machine,
                                            const cutting::Design& design_w);

}  // namespace abbe::sim
