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

/// What was found to meet while a program runs.
namespace abbe::sim {

/// Where in a program something is.
struct ProgramLocation {
  int line = 0;
  std::uint16_t file = 0;  ///< as `Block::file`
  double time_s = 0.0;
};

/// Two bodies that meet, or that come too near to each other.
struct Collision {
  std::string a, b;
  bool contact = true;      ///< else a near miss
  bool rapid = false;       ///< it begins on a rapid
  ProgramLocation first;    ///< of contact, or of coming within the clearance
  ProgramLocation worst;    ///< where it is deepest of what was looked at, or they are nearest
  ProgramLocation last;     ///< end of the block in which they part again
  double distance = 0.0;    ///< mm, of a near miss
  double depth = 0.0;       ///< mm, of contact: the shortest way out where
                            ///< that is longest of what was looked at
  std::size_t depths = 0;   ///< instants at which it was looked at; 0: not
  bool below_mesh = false;  ///< contact that the mesh of the stock does not show: it has no depth
  Eigen::Vector3d place_b = Eigen::Vector3d::Zero();  ///< mm, then, in the bed frame
  Eigen::Vector3d place_w = Eigen::Vector3d::Zero();  ///< mm, then, in the workpiece frame
  std::size_t part = 0;                               ///< of the job, with its tool
  kinematics::AxisState state;  ///< of the axes at first contact, or where they are nearest
  std::shared_ptr<const cutting::ClosedMesh>
      stock;  ///< of the first contact with the stock: as it is then, in the workpiece frame
};

/// In which blocks the clearance of a pair counts among the smallest.
enum class ClearanceScope {
  Always,
  WhenNear,       ///< in contacts and near misses: of the stock
  WhenInContact,  ///< in contacts: of cutter and shank with part or stock, which they may touch
  Never           ///< it is not looked at
};

/// How near two bodies come.
struct Clearance {
  std::string a, b;
  bool overlap_at_start = false;  ///< and are not looked at
  double distance = 0.0;  ///< mm, within 5 % or 0.01 mm; infinite of cutter and shank to the
                          ///< part or the stock, if they do not collide: they may touch
  ProgramLocation place;
  ClearanceScope in_blocks = ClearanceScope::Always;
};

/// The smallest clearance of a block, of the pairs that count there.
struct BlockClearance {
  ProgramLocation place;  ///< its beginning
  double end_s = 0.0;
  double at_least = 0.0;  ///< mm, the true one is at most 5 % or 0.01 mm more; 0 for contact
  int pair = -1;          ///< of `clearances`; -1: none is looked at
};

struct Collisions {
  std::string commands;                 ///< case whose commands they are
  std::vector<std::string> more_files;  ///< of the program, as Path has them
  struct NamedBody {
    std::string name, carrier;
    Eigen::Index triangles = 0;
  };
  std::vector<NamedBody> bodies;
  std::vector<Collision> list;        ///< in the order of the program
  std::vector<Clearance> clearances;  ///< of the pairs that were looked at
  std::vector<BlockClearance> blocks;
  std::vector<std::string> warnings;
  std::size_t queries = 0;  ///< of distances
  double seconds = 0.0;
  double resolution = 0.0, clearance = 0.0, gouge = 0.0;  ///< mm, as asked for
  std::string beyond_travel;  ///< the axis that leaves its travel, and where; empty: none does
};

/// What a person must know of them: contacts, ends of travel, how many near misses there are.
std::vector<std::string> collision_warnings(const Collisions& collisions);

/// A run that was to stop at a collision.
struct CollisionStop : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// "holder and clamp meet, 3.21 mm deep at line 13, 1.310 s: lines 12 to 14, from 1.234 s, on a
/// rapid"
/// @param all  to which it belongs
std::string event_text(const Collision& event, const Collisions& all);

/// How many of them are contact.
std::size_t contacts(const Collisions& collisions);

/// Whether the program can run: nothing meets, no axis leaves its travel.
bool is_clear(const Collisions& collisions);

// When the depth of a contact is looked at, which takes too long for every moment.

/// Of a motion in steps, so many moments of each may be looked at: what is thinner than a step is
/// deep only between its ends.
inline constexpr std::size_t samples_per_step = 8;

/// Contacts of which the depth is looked at.
inline constexpr std::size_t max_measured_contacts = 50;

/// Where a contact is deepest, of the moments at which it was looked at.
struct DeepestSample {
  double depth = 0.0;  ///< mm
  std::size_t at = 0;  ///< moment
  std::size_t looks = 0;
};

/// Looks at moments spread over [first, end), at up to as many ends of blocks, where motion turns
/// back, and between those beside the deepest.
/// @param block_ends  moments
/// @param depth_at    mm, of a moment
DeepestSample deepest_sample(std::size_t first, std::size_t end,
                             const std::vector<std::size_t>& block_ends,
                             const std::function<double(std::size_t)>& depth_at);

}  // namespace abbe::sim
