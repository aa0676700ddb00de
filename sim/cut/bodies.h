#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "cutting/stock/body.h"
#include "cutting/stock/encounters.h"
#include "sim/cut/collision_events.h"
#include "sim/cut/job.h"
#include "sim/cut/part.h"

/// What a machine, its tool, its clamping and its part are made of, and where that is.
namespace abbe::sim {

/// The frames that carry bodies: the bed, every joint's carriage, the workpiece w, the tool t.
struct Carriers {
  int joints = 0;  ///< of the chain

  static constexpr int bed = 0;
  int carriage(int joint) const { return 1 + joint; }
  int workpiece() const { return 1 + joints; }
  int tool() const { return 2 + joints; }
  int count() const { return 3 + joints; }
};

/// Their poses in the bed. Bodies of a carriage, as those of the bed, are placed where they are
/// with the axes at zero.
/// @param q, deviations  as of Chain
std::vector<kinematics::Pose> carrier_poses(const kinematics::Chain& chain,
                                            const kinematics::AxisVector& q,
                                            std::span<const kinematics::JointDeviation> deviations);

/// One body of a job.
struct SolidBody {
  enum class Kind { Machine, Fixture, Part, Holder, Shank, Cutter };
  Kind kind = Kind::Machine;
  std::string name;
  std::string carrier;                           ///< "b", "X", "w", "t"
  int frame = 0;                                 ///< number of the carrier
  cutting::ClosedMesh mesh;                      ///< as it looks, in the frame of its carrier
  std::vector<cutting::ClosedMesh> pieces = {};  ///< as it is looked at; empty: the mesh
  std::vector<cutting::ClosedMesh> core = {};    ///< of cutter and shank: without the skin that may
                                                 ///< be in the part, `collision.gouge_mm`
};

/// The mesh of a shape where its description places it. Facets of round bodies lie outside, by at
/// most a ten-thousandth of the radius and at least 5 um.
/// @param use  what the scene calls it
/// @throws BadInput for a mesh file that cannot be read or is not closed
cutting::ClosedMesh mesh_of(const BodyDescription& body, const MeshUse& use = {"a body", "body"});

/// The fixtures of a scene.
/// @throws BadInput as `mesh_of`
std::vector<SolidBody> fixture_bodies(const Scene& scene);

/// What the machine is made of.
/// @throws BadInput as `mesh_of`
std::vector<SolidBody> machine_bodies(const MachineDescription& machine);

/// Cutter, shank and holder of the true tool of a part.
/// @param skin  mm by which the cores of cutter and shank are smaller, at most a quarter of their
///              radius
std::vector<SolidBody> tool_bodies(const Job& part, double skin);

/// Every body of a part of a job: machine, fixtures, part, and of the true tool cutter, shank and
/// holder.
/// @throws BadInput as `mesh_of`
std::vector<SolidBody> job_bodies(const Job& part);

/// What is odd about the bodies of a job: that there are none, that a mesh is tiny, that a fixture
/// lies inside the part.
std::vector<std::string> body_warnings(const Job& part, const std::vector<SolidBody>& bodies);

/// The body to be searched, and its core; the whole of it where it has no core.
cutting::Body searched(const SolidBody& solid);
cutting::Body search_core(const SolidBody& solid);

/// Whether a pair is among those to be left out, in either order.
bool is_ignored(const std::vector<CollisionDescription::Pair>& ignored, const std::string& a,
                const std::string& b);

/// Pairs that may meet, by their numbers: not what is carried by one carriage, nor parts of the
/// machine that one axis joins.
/// @param ignored  pairs that are left out
std::vector<cutting::BodyPair> pairs_of(const kinematics::Chain& chain,
                                        const std::vector<SolidBody>& bodies,
                                        const std::vector<CollisionDescription::Pair>& ignored);

/// A part of a job as it is commanded, on the wrong machine. It refers to what it is made of.
struct ActualMotion {
  const Job& part;
  const Commands& commands;
  const program::Samples& samples = commands.samples;
  const program::Path& path = path_of(part, commands);

  /// Between two samples: axes and time in proportion, directions those of the way there; a
  /// workpiece spindle stands at 0.
  kinematics::AxisState state(const cutting::Moment& moment) const;
  /// Poses of all carriers, errors of axes and heat included.
  std::vector<kinematics::Pose> carriers(const cutting::Moment& moment) const;
  /// The sample to which the axes are on their way.
  std::size_t running(const cutting::Moment& moment) const;
  ProgramLocation place(const cutting::Moment& moment) const;
  bool is_rapid(const cutting::Moment& moment) const;
};

/// What is said of any collision at its first moment; its names are left open.
/// @param place_b  mm, in the bed
Collision collision_at(const ActualMotion& actual_motion, const cutting::Moment& moment,
                       const Eigen::Vector3d& place_b);

}  // namespace abbe::sim
