#pragma once

#include "render/machine_picture.h"
#include "sim/cut/cut.h"
#include "sim/cut/program_inspection.h"

namespace abbe::sim {

/// Returns machine, fixtures, part and path as `abbe check --picture` draws them: the axes half way
/// through the program; the bodies of the machine's description, or if it has none, carriages as
/// plain bodies stacked from the tool and from the part to the bed, which stands below them; the
/// nominal and the actual path, or segments of a long one, errors magnified.
render::MachinePicture machine_picture(const Job& job);

/// Returns machine and path of a program alone: feed moves and rapids, the axes at its end.
render::MachinePicture machine_picture(const ProgramInspection& alone);

/// Returns a round factor that magnifies the largest error of a path, mm, to about a twentieth of
/// the part; 1 if it is large enough already, or zero.
double round_magnification(double part_size, double largest_error);

/// A plain body in the frame of its carrier, `Carriers::carriage` or the bed, axes at zero.
struct SchematicBody {
  render::Body body;
  int frame = 0;
};

/// Returns carriages, spindle and bed of a machine whose description has no shapes, as in the
/// picture above, without the connecting pieces, which would have to stretch.
std::vector<SchematicBody> schematic_bodies(const Job& job);

}  // namespace abbe::sim
