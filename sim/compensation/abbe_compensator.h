#ifndef ABBE_COMPENSATOR_H
#define ABBE_COMPENSATOR_H

/* A compensator for abbe as a C function in a shared library. Plain C99; from C++ too. A library
   defines one object, abbe_compensator, and nothing else is looked for:

     static int32_t answer(void* self, const abbe_batch* batch, double* rows, char* error) { ... }
     const abbe_compensator_v1 abbe_compensator = {
         ABBE_COMPENSATOR_VERSION, ABBE_CORRECTION, "mine", NULL, answer, NULL};

     cc -shared -fPIC -O2 -I FOLDER_OF_THIS_FILE -o mine.so mine.c

   Lengths are mm, angles rad, times s. Tables are rows one after another. All calls come from one
   thread of a process that holds nothing but the library. */

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define ABBE_COMPENSATOR_VERSION 1
#define ABBE_ERROR_BYTES 512 /* room for an error text, its end included */

/* What the numbers of an answer mean. */
enum {
  ABBE_CORRECTION = 0, /* joints a row: to be added to the commands */
  ABBE_DEVIATION = 1   /* 6 a row: EX EY EZ EA EB EC of the tool as believed, actual minus nominal
                          in the nominal tool frame; abbe finds the correction */
};

enum { ABBE_TOOL_SIDE = 0, ABBE_WORKPIECE_SIDE = 1 };
enum { ABBE_LINEAR = 0, ABBE_ROTARY = 1, ABBE_SPINDLE = 2 };

/* One joint, in the bed frame with all axes at zero. */
typedef struct abbe_joint {
  char name;           /* 'X' */
  int32_t side;        /* ABBE_TOOL_SIDE or ABBE_WORKPIECE_SIDE */
  int32_t motion;      /* ABBE_LINEAR, ABBE_ROTARY or ABBE_SPINDLE */
  double direction[3]; /* unit; a positive command moves the tool this way in the workpiece */
  double point[3];     /* on the line of a rotation */
  double min;          /* limits of travel as commanded */
  double max;
} abbe_joint;

/* The machine and what its control could read. Lives as long as the compensator does. */
typedef struct abbe_task {
  const char* structure; /* "w C' b X Y Z A s t": joints from the workpiece to the tool */
  int32_t joints;
  const abbe_joint* joint; /* (joints) */
  const char* tool;        /* its name */
  double tool_length;
  int64_t samples;            /* that will be asked in all */
  int32_t readings;           /* may be 0 */
  const char* const* reading; /* (readings) names with units, "room_C" */
  int64_t log_rows;
  const double* log_time_s; /* (log_rows); before 0 the history before the program */
  const double* log;        /* (log_rows x readings); NaN where there was none */
} abbe_task;

/* Some samples in the order of time. */
typedef struct abbe_batch {
  int64_t samples;
  const double* time_s;      /* (samples) */
  const double* q;           /* (samples x joints) commands */
  const double* direction;   /* (samples x joints) +1 up, -1 down, 0 has not moved yet */
  const double* spindle_rpm; /* (samples) */
  const double* T_wt;        /* (samples x 12) where the tool should be in the workpiece: the first
                                three rows of the 4 x 4 matrix; tip at 3 7 11, axis at 2 6 10 */
  const double* readings;    /* (samples x readings) last read before the sample */
} abbe_batch;

typedef struct abbe_compensator_v1 {
  int32_t version;  /* ABBE_COMPENSATOR_VERSION */
  int32_t answers;  /* ABBE_CORRECTION or ABBE_DEVIATION */
  const char* name; /* as it calls itself */
  /* Called first with where to put what the compensator wants to keep; may be NULL. Returns 0, or
     not 0 after writing why into `error` (ABBE_ERROR_BYTES). */
  int32_t (*open)(void** self, const abbe_task* task, char* error);
  /* Fills `rows` (samples x joints, or samples x 6) with finite numbers. Returns as open does. */
  int32_t (*answer)(void* self, const abbe_batch* batch, double* rows, char* error);
  /* Called last if open succeeded; may be NULL. */
  void (*close)(void* self);
} abbe_compensator_v1;

#if defined(__GNUC__)
__attribute__((visibility("default")))
#endif
extern const abbe_compensator_v1 abbe_compensator;

#ifdef __cplusplus
}
#endif

#endif
