#pragma once

#include <memory>
#include <string>

#include "core/result.h"

namespace ivis {

/// An OpenGL core context without a window, by EGL.
/// Threads: current in one thread at a time; whoever has it takes turns.
/// Ownership: of the context, and with it of every object made in it. EGL's displays stay
/// initialised: others in the process may use the same ones, and terminating is not counted.
class GlContext {
 public:
  struct Options {
    bool surfaceless = true;     ///< try EGL_MESA_platform_surfaceless, first
    bool devices = true;         ///< then every device of EGL_EXT_platform_device
    bool hardware_only = false;  ///< refuse rasterisers that run on the CPU
    int major = 4, minor = 5;    ///< least version
  };

  /// The first that draws by hardware; else the first that works, unless hardware_only. With
  /// LIBGL_ALWAYS_SOFTWARE set to other than 0, the first that works.
  /// Errors: kUnsupported, saying of each display what is missing.
  static Result<std::unique_ptr<GlContext>> create(const Options& options);
  static Result<std::unique_ptr<GlContext>> create() { return create(Options{}); }
  ~GlContext();
  GlContext(const GlContext&) = delete;
  GlContext& operator=(const GlContext&) = delete;

  /// While it lives the context is current in this thread; then what was before is so again (an EGL
  /// context: one that another interface made current stays released).
  class Current {
   public:
    Current(Current&& other) noexcept;
    Current(const Current&) = delete;
    Current& operator=(const Current&) = delete;
    Current& operator=(Current&&) = delete;
    ~Current();

   private:
    friend class GlContext;
    struct Before;
    explicit Current(std::unique_ptr<Before> before);
    std::unique_ptr<Before> before_;
  };
  /// Errors: kUnsupported if the context is gone or in use by another thread.
  Result<Current> make_current() const;

  /// Of all that was done in the current context since the last call. Waits for nothing: call it
  /// after reading results back. Errors: kUnsupported if the context was lost or a call was
  /// refused.
  Status check() const;

  /// "llvmpipe (LLVM 15.0.6, 256 bits)" or the like, and by which display.
  const std::string& renderer() const { return renderer_; }
  bool is_software() const { return software_; }

  /// From now on make_current() fails: for tests of what happens then. Not while it is current.
  void destroy();

 private:
  GlContext() = default;
  static Result<std::unique_ptr<GlContext>> on_display(void* display, const std::string& name,
                                                       const Options& options);

  void* display_ = nullptr;
  void* context_ = nullptr;
  std::string renderer_;
  bool software_ = false;
};

}  // namespace ivis
