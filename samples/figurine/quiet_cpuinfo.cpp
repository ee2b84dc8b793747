// XNNPACK's cpuinfo writes lines of its own to standard error before XNNPACK reports that it cannot
// start, which is one line here (runtime/src/nn/xnnpack_graph.cpp). The dynamic linker looks at the
// program first, so this takes the place of what writes them; a cpuinfo without such a function is
// as loud as it was. Libraries do not decide that for the programs which use them: this is the
// program's.
#include <cstdarg>

// The linker sees no reason to export what is hidden by default.
extern "C" [[gnu::visibility("default")]] void cpuinfo_vlog_error(const char* format,
                                                                  va_list arguments);
extern "C" void cpuinfo_vlog_error(const char*, va_list) {}
