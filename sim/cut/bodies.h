#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "cutting/stock/body.h"
#include "cutting/stock/encounters.h"
#include "sim/cut/collision_events.h"
#include "sim/cut/job.h"
#include "sim/cut/part.h"

/// The bodies of a job (machine, fixtures, part, tool), the frames that carry them, and their
/// motion along the commands.
namespace abbe::sim {

/// The numbers of the frames that carry bodies: the bed, the carriage of every joint, the workpiece
/// w and the tool t.
struct Carriers {
  int joints = 0;  ///< number of joints of the chain

  static constexpr int bed = 0;
  int carriage(int joint) const { return 1 + joint; }
  int workpiece() const { return 1 + joints; }
  int tool() const { return 2 + joints; }
  int count() const { return 3 + joints; }
};

/// Returns the poses of all carriers in the bed frame. Bodies of the bed and of the carriages are
/// described in the bed frame with all axes at zero.
/// @param q, deviations  as of Chain
std::vector<kinematics::Pose> carrier_poses(const kinematics::Chain& chain,
                                            const kinematics::AxisVector& q,
                                            std::span<const kinematics::JointDeviation> deviations);

/// A body of a job, with the carrier that moves it.
struct SolidBody {
  enum class Kind { Machine, Fixture, Part, Holder, Shank, Cutter };
  Kind kind = Kind::Machine;
  std::string name;
  std::string carrier;                           ///< name of the carrier: "b", "X", "w", "t"
  int frame = 0;                                 ///< number of the carrier in `Carriers`
  cutting::ClosedMesh mesh;                      ///< as drawn, in the frame of the carrier
  std::vector<cutting::ClosedMesh> pieces = {};  ///< for the collision search; empty: `mesh`
  std::vector<cutting::ClosedMesh> core = {};    ///< of cutter and shank, without the skin of
                                                 ///< `collision.gouge_mm` that may enter the part
};

/// Returns the mesh of a body at its pose. Facets of round bodies lie outside the true surface by
/// at most 5 um or a ten-thousandth of the radius, whichever is more.
/// @param use  name of the body in messages
/// @throws BadInput if a mesh file cannot be read or is not closed
cutting::ClosedMesh body_mesh(const BodyDescription& body, const MeshUse& use = {"a body", "body"});

/// Returns the fixtures of a scene.
/// @throws BadInput as `body_mesh`
std::vector<SolidBody> fixture_bodies(const Scene& scene);

/// Returns the bodies of the machine, each on its carriage or on the bed.
/// @throws BadInput as `body_mesh`
std::vector<SolidBody> machine_bodies(const MachineDescription& machine);

/// Returns cutter, shank and holder of the actual tool of a segment.
/// @param skin  thickness by which the cores of cutter and shank are smaller, mm, at most a quarter
///     of their radius
std::vector<SolidBody> tool_bodies(const Segment& segment, double skin);

/// Returns every body of a segment: machine, fixtures, part, and cutter, shank and holder of the
/// actual tool.
/// @throws BadInput as `body_mesh`
std::vector<SolidBody> segment_bodies(const Job& job, const Segment& segment);

/// Returns warnings about the bodies of a segment, such as no bodies at all, a tiny mesh, or a
/// fixture inside the part.
std::vector<std::string> body_warnings(const Segment& segment,
                                       const std::vector<SolidBody>& bodies);

/// Returns the body for the collision search.
cutting::Body search_body(const SolidBody& solid);
/// Returns the core of a body for the collision search, or the whole body if it has no core.
cutting::Body search_core(const SolidBody& solid);

/// Returns true if the pair is in the list of ignored pairs, in either order.
bool is_ignored(const std::vector<CollisionDescription::Pair>& ignored, const std::string& a,
                const std::string& b);

/// Returns the pairs of bodies that may collide, by their numbers: not those on the same carriage,
/// nor those of machine bodies with only one axis between them.
/// @param ignored  further pairs to leave out
std::vector<cutting::BodyPair> collision_pairs(
    const kinematics::Chain& chain, const std::vector<SolidBody>& bodies,
    const std::vector<CollisionDescription::Pair>& ignored);

/// A commanded sample of a tool.
struct CommandedSample {
  kinematics::AxisState state;
  int line = 0;
  std::size_t block = 0;   ///< number that tells the blocks of the tool apart
  std::uint16_t file = 0;  ///< as in `Block::file`
  bool is_rapid = false;
};

/// The commanded samples of one tool: held, or made again window by window, of which the last few
/// are kept. Refers to its arguments. Thread-safe.
class CommandedSamples {
 public:
  CommandedSamples(const Segment& segment, const Commands& commands);
  /// @param tool  index in `tool_segments` of a job in windows
  /// @throws BadInput if a commanded axis leaves its travel
  CommandedSamples(const Job& job, std::size_t tool, const WindowedProgram& program);

  std::size_t size() const { return count_; }
  CommandedSample operator[](std::size_t i) const;

 private:
  struct Range {
    program::Samples samples;
    program::Path path;
    std::size_t first = 0;        // number of its first sample
    std::size_t first_block = 0;  // number of the first block of its path
  };
  static CommandedSample sample_of(const program::Samples& samples, const program::Path& path,
                                   std::size_t i, std::size_t first_block);
  std::shared_ptr<const Range> range_with(std::size_t sample) const;

  const program::Samples* samples_ = nullptr;  // held
  const program::Path* path_ = nullptr;
  std::size_t count_ = 0;
  std::function<Range(std::size_t window)> make_range_;
  std::vector<std::size_t> starts_;  // (windows) number of the first sample of each
  mutable std::mutex mutex_;
  mutable std::vector<std::pair<std::size_t, std::shared_ptr<const Range>>>
      kept_;  // windows, the latest last
};

/// The motion of a segment under its commands on the machine with errors. Holds references to
/// its arguments.
struct ActualMotion {
  const Segment& segment;
  const CommandedSamples& samples;

  /// Returns the axis state at a moment. Axes and time are interpolated linearly between samples;
  /// directions are those of the motion to the next sample. A workpiece spindle is at 0.
  kinematics::AxisState state(const cutting::Moment& moment) const;
  /// Returns the poses of all carriers, with the errors of the axes and the heat.
  std::vector<kinematics::Pose> carriers(const cutting::Moment& moment) const;
  /// Returns the number of the sample that the axes are moving to.
  std::size_t target_sample(const cutting::Moment& moment) const;
  /// Returns the program location at a moment.
  ProgramLocation place(const cutting::Moment& moment) const;
  /// Returns true if the move at a moment is a rapid.
  bool is_rapid(const cutting::Moment& moment) const;
};

/// Returns a collision at its first moment, without the names of the bodies.
/// @param place_b  contact point in the bed frame, mm
Collision collision_at(const ActualMotion& actual_motion, const cutting::Moment& moment,
                       const Eigen::Vector3d& place_b);

}  // namespace abbe::sim
