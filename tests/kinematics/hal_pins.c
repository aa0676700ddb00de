/* Runs one of LinuxCNC's kinematics modules outside of LinuxCNC: the module is loaded as it is, and
   the few functions of the HAL that it calls are supplied here. Its interface is stated again below,
   so that no header of LinuxCNC is needed. Numbers are hexadecimal: not a bit is lost.

     hal_pins MODULE.so < commands
       pin NAME VALUE        sets an input, "xyzac-trt-kins.y-offset"
       switch N              kinematicsSwitch(N)
       forward 9 NUMBERS     positions of joints to "x y z a b c u v w"
       inverse 9 NUMBERS     "x y z a b c u v w" to positions of joints
   Ends with 1 and a line on stderr at the first thing that goes wrong. */
#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { most_pins = 64, numbers = 9, most_joints = 16 };

static struct {
  char name[128];
  double* value;
} pins[most_pins];
static int pin_count;

static void fail(const char* what, const char* which) {
  fprintf(stderr, "hal_pins: %s %s\n", what, which);
  exit(1);
}

int hal_init(const char* name) { return name ? 1 : -1; }
int hal_ready(int component) { return component < 0; }
int hal_set_unready(int component) { return component < 0; }
int hal_exit(int component) { return component < 0; }
void* hal_malloc(long size) { return calloc(1, (size_t)size); }

int hal_pin_float_newf(int direction, double** pin, int component, const char* format, ...) {
  va_list arguments;
  (void)direction;
  if (pin_count == most_pins || component < 0) return -1;
  va_start(arguments, format);
  vsnprintf(pins[pin_count].name, sizeof pins[pin_count].name, format, arguments);
  va_end(arguments);
  *pin = pins[pin_count++].value = calloc(1, sizeof(double));
  return *pin == NULL;
}

/* pins that say which kinematics are on: the module writes them, nobody reads them */
static int unread(void** pin) {
  *pin = calloc(1, sizeof(double));
  return *pin == NULL;
}
int hal_pin_bit_new(const char* name, int direction, void** pin, int component) {
  (void)name, (void)direction, (void)component;
  return unread(pin);
}
int hal_pin_s32_new(const char* name, int direction, void** pin, int component) {
  (void)name, (void)direction, (void)component;
  return unread(pin);
}
int hal_pin_s32_newf(int direction, void** pin, int component, const char* format, ...) {
  (void)direction, (void)component, (void)format;
  return unread(pin);
}

void rtapi_print(const char* format, ...) { (void)format; }
void rtapi_print_msg(int level, const char* format, ...) {
  va_list arguments;
  if (level > 1) return; /* 1: an error */
  va_start(arguments, format);
  vfprintf(stderr, format, arguments);
  va_end(arguments);
}
int rtapi_snprintf(char* text, unsigned long size, const char* format, ...) {
  va_list arguments;
  va_start(arguments, format);
  const int length = vsnprintf(text, size, format, arguments);
  va_end(arguments);
  return length;
}

typedef int (*Setup)(void);
typedef int (*Switch)(int kind);
typedef int (*Turn)(const double* from, double* to, const unsigned long* from_flags,
                    unsigned long* to_flags);

static void* symbol_of(void* module, const char* name) {
  void* symbol = dlsym(module, name);
  if (symbol == NULL) fail("no function", name);
  return symbol;
}

static void set_pin(const char* name, double value) {
  for (int i = 0; i < pin_count; ++i)
    if (strcmp(pins[i].name, name) == 0) {
      *pins[i].value = value;
      return;
    }
  fail("no pin", name);
}

static void turn(Turn function, const char* name) {
  double from[most_joints] = {0}, to[most_joints] = {0};
  unsigned long from_flags = 0, to_flags = 0;
  for (int i = 0; i < numbers; ++i)
    if (scanf("%lf", &from[i]) != 1) fail("nine numbers are wanted behind", name);
  if (function(from, to, &from_flags, &to_flags) != 0) fail("refused:", name);
  for (int i = 0; i < numbers; ++i) printf("%a%c", to[i], i + 1 == numbers ? '\n' : ' ');
}

int main(int argc, char** argv) {
  char word[128];
  if (argc != 2) fail("expected", "MODULE.so");
  void* module = dlopen(argv[1], RTLD_NOW | RTLD_GLOBAL);
  if (module == NULL) fail("cannot load:", dlerror());
  if (((Setup)symbol_of(module, "rtapi_app_main"))() != 0) fail("no start of", argv[1]);
  ((Setup)symbol_of(module, "kinematicsType"))(); /* some make their pins here */
  const Turn forward = (Turn)symbol_of(module, "kinematicsForward");
  const Turn inverse = (Turn)symbol_of(module, "kinematicsInverse");
  while (scanf("%127s", word) == 1) {
    if (strcmp(word, "pin") == 0) {
      double value;
      if (scanf("%127s %lf", word, &value) != 2) fail("a name and a value are wanted behind", "pin");
      set_pin(word, value);
    } else if (strcmp(word, "switch") == 0) {
      int kind;
      if (scanf("%d", &kind) != 1) fail("a number is wanted behind", "switch");
      if (((Switch)symbol_of(module, "kinematicsSwitch"))(kind) != 0) fail("refused:", "switch");
    } else if (strcmp(word, "forward") == 0) {
      turn(forward, word);
    } else if (strcmp(word, "inverse") == 0) {
      turn(inverse, word);
    } else {
      fail("unknown word", word);
    }
  }
  return 0;
}
