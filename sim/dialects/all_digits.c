/* Preloaded into LinuxCNC's rs274, whose numbers then have all their digits: what it prints goes
   through libc's printf, or its checked one, with "%.4f" or "%f". */
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

static int print_all_digits(FILE* file, const char* format, va_list arguments) {
  char digits[2048];
  const char* from = format;
  char* to = digits;
  while (*from && to < digits + sizeof digits - 8) {
    const size_t four = strncmp(from, "%.4f", 4) == 0 ? 4 : strncmp(from, "%f", 2) == 0 ? 2 : 0;
    if (four) {
      memcpy(to, "%.17g", 5);
      to += 5;
      from += four;
    } else {
      *to++ = *from++;
    }
  }
  *to = '\0';
  return vfprintf(file, *from ? format : digits, arguments);
}

int __fprintf_chk(FILE* file, int flag, const char* format, ...) {
  va_list arguments;
  (void)flag;
  va_start(arguments, format);
  const int written = print_all_digits(file, format, arguments);
  va_end(arguments);
  return written;
}

int fprintf(FILE* file, const char* format, ...) {
  va_list arguments;
  va_start(arguments, format);
  const int written = print_all_digits(file, format, arguments);
  va_end(arguments);
  return written;
}
