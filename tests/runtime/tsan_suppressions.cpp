// XNNPACK and its pool are not instrumented: the thread sanitizer sees their memcpy, but not the
// locks around it. What they call is left out; our own loops run on threads of our own and are
// looked at.
#if defined(__SANITIZE_THREAD__)
extern "C" __attribute__((visibility("default"))) const char* __tsan_default_suppressions() {
  return "called_from_lib:libXNNPACK.so\ncalled_from_lib:libpthreadpool.so\n";
}
#endif
