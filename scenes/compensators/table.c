/* The table of table.py as a shared library:
     cc -std=c99 -shared -fPIC -O2 -I sim/compensation -o table.so scenes/compensators/table.c */

#include <stdlib.h>

#include "abbe_compensator.h"

struct row {
  double q;  /* mm along the axis */
  double um; /* that it stood too far */
};
struct table {
  char axis;
  int rows;
  struct row row[7];
};

static const struct table tables[] = {
    {'X',
     7,
     {{-300, 6.0}, {-200, 2.0}, {-100, 0.5}, {0, 0.0}, {100, -1.0}, {200, -3.9}, {300, -10.2}}},
    {'Y',
     7,
     {{-300, -4.3}, {-200, -2.8}, {-100, -1.4}, {0, 0.0}, {100, 1.7}, {200, 3.9}, {300, 6.5}}},
    {'Z', 5, {{-50, -0.4}, {50, -0.1}, {150, -1.0}, {250, -3.2}, {350, -10.3}}},
};

static double correction(const struct table* table, double q) {
  const struct row* row = table->row;
  const struct row* last = row + table->rows - 1;
  if (q < row->q) q = row->q;
  if (q > last->q) q = last->q;
  while (q > row[1].q) ++row;
  return -0.001 * (row->um + (row[1].um - row->um) * (q - row->q) / (row[1].q - row->q));
}

/* What it keeps: the table of each joint, NULL where it has none. */
struct kept {
  int32_t joints;
  const struct table* of[32];
};

static int32_t open_table(void** self, const abbe_task* task, char* error) {
  struct kept* kept = calloc(1, sizeof *kept);
  (void)error;
  if (kept == NULL || task->joints > 32) return 1;
  kept->joints = task->joints;
  for (int32_t j = 0; j < task->joints; ++j)
    for (size_t t = 0; t < sizeof tables / sizeof *tables; ++t)
      if (tables[t].axis == task->joint[j].name) kept->of[j] = &tables[t];
  *self = kept;
  return 0;
}

static int32_t answer(void* self, const abbe_batch* batch, double* rows, char* error) {
  const struct kept* kept = self;
  (void)error;
  for (int64_t i = 0; i < batch->samples; ++i)
    for (int32_t j = 0; j < kept->joints; ++j, ++rows)
      *rows = kept->of[j] ? correction(kept->of[j], batch->q[i * kept->joints + j]) : 0.0;
  return 0;
}

static void close_table(void* self) { free(self); }

const abbe_compensator_v1 abbe_compensator = {
    ABBE_COMPENSATOR_VERSION, ABBE_CORRECTION, "laser table", open_table, answer, close_table};
