#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "cutting/stock/body.h"
#include "kinematics/axes.h"

/// Collisions, near misses and clearances of a program, and their texts.
namespace abbe::sim {

/// A location in the program: line, file and time.
struct ProgramLocation {
  int line = 0;
  std::uint16_t file = 0;  ///< number of the file, as in `Block::file`
  double time_s = 0.0;
};

/// Two bodies that touch or come nearer than the clearance.
struct Collision {
  std::string a, b;
  bool contact = true;    ///< false: a near miss
  bool rapid = false;     ///< true if the event begins on a rapid
  ProgramLocation first;  ///< where the contact begins, or the distance falls below the clearance
  ProgramLocation worst;  ///< of the largest sampled depth, or of the smallest distance
  ProgramLocation last;   ///< end of the block in which the bodies part again
  double distance = 0.0;  ///< smallest distance of a near miss, mm
  double depth = 0.0;     ///< penetration depth of a contact, mm: the largest, over the sampled
                          ///< moments, of the shortest displacement that separates the bodies
  std::size_t depth_samples = 0;  ///< number of moments at which the depth was sampled
  bool below_mesh = false;  ///< true for a contact without depth, which is too shallow for the mesh
                            ///< of the stock to show
  Eigen::Vector3d place_b = Eigen::Vector3d::Zero();  ///< contact point in the bed frame, mm, at
                                                      ///< the first contact or the nearest moment
  Eigen::Vector3d position_w = Eigen::Vector3d::Zero();  ///< the same in the workpiece frame, mm
  std::size_t part = 0;         ///< number of the part of the job, which sets the tool
  kinematics::AxisState state;  ///< axes at the first contact, or at the nearest moment
  std::shared_ptr<const cutting::ClosedMesh>
      stock;  ///< shape of the stock at its first contact, workpiece frame
};

/// The blocks to whose smallest clearance the clearance of a pair contributes.
enum class ClearanceScope {
  Always,
  WhenNear,       ///< blocks with a contact or near miss, for pairs with the stock
  WhenInContact,  ///< blocks with a contact, for cutter and shank, which may touch part and stock
  Never           ///< the pair is not searched
};

/// The smallest distance between two bodies over the program.
struct Clearance {
  std::string a, b;
  bool overlap_at_start = false;  ///< true if the bodies overlap at the start of the program; they
                                  ///< are not searched then
  double distance = 0.0;  ///< mm, to 5 % or 0.01 mm; for cutter and shank with part or stock, which
                          ///< they may touch, infinite unless they collide
  ProgramLocation place;
  ClearanceScope in_blocks = ClearanceScope::Always;
};

/// The smallest clearance in a block.
struct BlockClearance {
  ProgramLocation place;  ///< start of the block
  double end_s = 0.0;
  double min_clearance = 0.0;  ///< lower bound of the clearance, mm, which is larger by 5 % or 0.01
                               ///< mm at most; 0 for contact
  int pair = -1;               ///< index in `clearances`; -1: no pair is searched
};

/// The result of a collision search over a program.
struct Collisions {
  std::string commands;                       ///< name of the case whose commands were followed
  std::vector<std::string> subprogram_files;  ///< further files of the program, as in Path
  struct NamedBody {
    std::string name, carrier;
    Eigen::Index triangles = 0;
  };
  std::vector<NamedBody> bodies;
  std::vector<Collision> list;        ///< in the order of the program
  std::vector<Clearance> clearances;  ///< one for each searched pair
  std::vector<BlockClearance> blocks;
  std::vector<std::string> warnings;
  std::size_t queries = 0;  ///< number of distance queries
  double seconds = 0.0;
  double resolution = 0.0, clearance = 0.0, gouge = 0.0;  ///< mm, as in the scene
  std::string beyond_travel;  ///< names the first axis that leaves its travel, and where; empty:
                              ///< none does
};

/// Returns the warnings for the user: contacts, axes beyond their travel, number of near misses.
std::vector<std::string> collision_warnings(const Collisions& collisions);

/// Thrown when a run that should stop at a collision finds one.
struct CollisionStop : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Returns a text such as "holder and clamp meet, 3.21 mm deep at line 13, 1.310 s: lines 12 to 14,
/// from 1.234 s, on a rapid".
/// @param result  that contains the event
std::string event_text(const Collision& event, const Collisions& result);

/// Returns the number of contacts, near misses not counted.
std::size_t contacts(const Collisions& collisions);

/// Returns true if the program can run: no contact, and no axis leaves its travel.
bool is_clear(const Collisions& collisions);

// The penetration depth of a contact is sampled, since a query is too slow for every moment.

/// Number of moments within a step of the motion at which the depth may be sampled: a body thinner
/// than a step is deepest between the ends of the step.
inline constexpr std::size_t samples_per_step = 8;

/// Number of contacts whose depth is sampled.
inline constexpr std::size_t max_measured_contacts = 50;

/// The deepest of the sampled moments of a contact.
struct DeepestSample {
  double depth = 0.0;            ///< mm
  std::size_t moment = 0;        ///< its number
  std::size_t sample_count = 0;  ///< number of moments sampled
};

/// Samples the depth at up to 24 moments spread over [first, end), at up to 24 ends of blocks,
/// where the motion may reverse, and then repeatedly in the middle between the deepest sample and
/// its neighbours.
/// @param block_ends  moments
/// @param depth_at    returns the depth at a moment, mm
DeepestSample deepest_sample(std::size_t first, std::size_t end,
                             const std::vector<std::size_t>& block_ends,
                             const std::function<double(std::size_t)>& depth_at);

}  // namespace abbe::sim
