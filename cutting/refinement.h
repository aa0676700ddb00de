#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "cutting/edge_residual.h"
#include "cutting/refine.h"
#include "cutting/triangle_mesh.h"

namespace abbe::cutting {

/// The work of `refined`: rounds in which edges are probed, turned and split.
class Refinement {
 public:
  Refinement(const Design& design, const OnSurface& on_surface, const Sound& sound,
             const RefineOptions& options);
  Refined run();

 private:
  /// An edge that misses too much to stay, with its ends when it was probed.
  struct Waiting {
    int edge;
    std::array<int, 2> ends;
    EdgeProbe probe;
    std::array<int, 2> across = {-1, -1};  ///< corners between which it was tried to turn it
  };
  /// A place of an edge to be probed.
  struct ProbePlace {
    std::size_t edge;
    double u;
    bool is_crest = false;  ///< of two passes: that is where it is best split
  };

  /// A place of a face to be probed.
  struct Within {
    int face = -1;
    Contact place;
    double plane = 0.0;        ///< mm, of the face there
    bool is_doubtful = false;  ///< the slopes at its corners do not rule out that it is missed
  };
  /// What came of a probe into faces.
  struct SplitFaces {
    std::vector<int> made;  ///< edges
    double missed = 0.0;    ///< share of the faces, split or not
  };

  std::vector<Knot> sounded(const std::vector<Contact>& places,
                            std::vector<std::uint8_t> judged = {});
  void probe(const std::vector<int>& edges, const std::vector<ProbePlace>& at,
             std::vector<EdgeProbe>& probes);
  std::vector<EdgeProbe> probed(const std::vector<int>& open);
  std::vector<int> doubtful(const std::vector<int>& edges, bool all) const;
  void defer(const std::vector<int>& edges, std::vector<EdgeProbe> probes);
  void demand_split(std::vector<int> edges);
  std::vector<int> split_first(const Waiting& one, double level) const;
  std::vector<char> ready(double level);
  std::vector<int> split(double level, Eigen::Index most);
  void turn_edges(double level);
  std::optional<EdgeProbe> across_probe(const Waiting& one, std::span<Knot> found) const;
  void note_change(const std::vector<int>& edges);
  std::vector<int> faces_to_probe();
  bool is_followed(const std::array<int, 3>& corners) const;
  Within within(int face, int turn) const;
  SplitFaces split_faces(Eigen::Index most, int turn);
  double lower(double level) const;
  Design design() const;
  Surface surface() const;

  bool is_open(int edge) const;
  bool is_doubtful(int edge, double level) const;
  bool is_missed_beside(int edge, const Knot& place, double level) const;
  bool is_surely_met(int edge) const;
  bool crosses_passes(const Knot& a, const Knot& b) const;
  bool may_turn(int edge) const;
  double jitter(int edge) const;
  double share_of(int edge) const;
  std::array<int, 2> across(int edge) const;
  Span span(int edge) const;
  double length(const std::array<int, 2>& ends) const;
  double tolerance() const;
  const Knot& knot(int i) const { return knots_[std::size_t(i)]; }

  const Design& given_;
  const OnSurface& on_surface_;
  const Sound& sound_;
  const RefineOptions& options_;
  TriangleMesh mesh_;
  std::vector<Knot> knots_;
  std::vector<Waiting> waiting_;
  std::vector<int>
      place_;  // (edges) among those that wait while it is found which are ready; or -1
  std::vector<int> changed_;  // faces, since they were probed; with repeats
  bool all_changed_ = true;   // as at the beginning of every turn
  Eigen::Index probed_ = 0;
};

}  // namespace abbe::cutting
