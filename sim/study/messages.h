#pragma once

#include <exception>
#include <string>
#include <string_view>
#include <vector>

#include "sim/study/batch.h"
#include "sim/study/journal.h"

/// What ranks of a farm say to each other, as bytes; the ranks run one program on one kind of
/// computer.
namespace abbe::sim::study {

std::string to_bytes(const Batch& batch);
Batch batch_in(std::string_view bytes);

struct Finished {
  Batch batch;
  std::vector<Row> rows;
};
std::string to_bytes(const Finished& finished);
Finished finished_in(std::string_view bytes);

/// Empty for none.
std::string to_bytes(const std::exception_ptr& failure);
/// One with the same message, of the same type where the exit code depends on it; none of empty
/// bytes.
std::exception_ptr failure_in(const std::string& bytes);

}  // namespace abbe::sim::study
