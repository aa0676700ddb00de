#pragma once

#include <cstdint>
#include <vector>

#include "sim/study/farm.h"
#include "sim/study/influence.h"
#include "sim/study/study.h"

namespace abbe::sim::study {

/// Cases of one analysis, numbered through.
struct Block {
  enum class Kind { Base, OneAtATime, MonteCarlo, Sobol, Sweep, Proof } kind = Kind::Base;
  std::uint64_t first = 0;
  std::uint64_t count = 0;
  int sweep = 0;      ///< which one
  bool full = false;  ///< cut, not taken from the influence maps
};
const char* name_of(Block::Kind kind);

/// All cases of a study in their order: the base machine, one at a time (input by input, minus then
/// plus), Monte-Carlo, Sobol (base point by base point: A, B, A with column i of B), sweeps, proofs
/// (the first cases of Monte-Carlo again, cut).
struct Plan {
  std::vector<Block> blocks;
  std::uint64_t cases = 0;
};
Plan plan_of(const Study& study);

/// The block of a case. @param index  below plan.cases
const Block& block_of(const Plan& plan, std::uint64_t index);

/// Points of the unit cube as values of the inputs, correlated as the study says.
/// @param u  (inputs x cases)
Eigen::MatrixXd drawn(const Study& study, const Eigen::MatrixXd& u);

/// Inputs of the cases first .. last - 1. (inputs x cases)
Eigen::MatrixXd inputs_of(const Study& study, const Plan& plan, std::uint64_t first,
                          std::uint64_t last);

/// The plan cut into batches that are always computed whole: 72 cases of influence maps, one that
/// is cut.
std::vector<Batch> batches_of(const Plan& plan);

/// A study made ready to compute its cases. Immutable once made.
struct PreparedStudy {
  Study study;
  Plan plan;
  std::vector<PreparedConfiguration> arms;
  std::vector<InfluenceMap> influences;  ///< (arms) empty with the full engine
};

/// Prepares every arm and, unless every case is cut, its influence map.
/// @throws BadScene, BadInput
PreparedStudy prepare_study(const Study& study, const Progress& progress = {});

/// Computes batches of a study, each the same rows whoever computes it. A machine that cannot cut
/// the program has a row that says why. Safe from many threads; `ready` outlives it.
ComputeBatch batch_computation(const PreparedStudy& ready);

/// Column of a response in the answers of a row: arm by arm, response by response.
std::size_t response_column(const Study& study, std::size_t arm, std::size_t response);

}  // namespace abbe::sim::study
