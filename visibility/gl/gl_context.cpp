#include "visibility/gl/gl_context.h"

#include <cstdlib>
#include <cstring>
#include <utility>
#include <vector>

#include <epoxy/egl.h>
#include <epoxy/gl.h>

namespace ivis {
namespace {

std::string egl_error() {
  const EGLint code = eglGetError();
  switch (code) {
    case EGL_SUCCESS:
      return "no error given";
    case EGL_NOT_INITIALIZED:
      return "EGL_NOT_INITIALIZED";
    case EGL_BAD_ACCESS:
      return "EGL_BAD_ACCESS";
    case EGL_BAD_ALLOC:
      return "EGL_BAD_ALLOC";
    case EGL_BAD_ATTRIBUTE:
      return "EGL_BAD_ATTRIBUTE";
    case EGL_BAD_CONFIG:
      return "EGL_BAD_CONFIG";
    case EGL_BAD_CONTEXT:
      return "EGL_BAD_CONTEXT";
    case EGL_BAD_DISPLAY:
      return "EGL_BAD_DISPLAY";
    case EGL_BAD_MATCH:
      return "EGL_BAD_MATCH";
    case EGL_CONTEXT_LOST:
      return "EGL_CONTEXT_LOST";
    default:
      return "EGL error " + std::to_string(code);
  }
}

bool runs_on_cpu(const std::string& renderer) {
  for (const char* name : {"llvmpipe", "softpipe", "swrast", "SWR", "SwiftShader", "Software"})
    if (renderer.find(name) != std::string::npos) return true;
  return false;
}

bool software_wanted() {
  const char* value = std::getenv("LIBGL_ALWAYS_SOFTWARE");
  return value != nullptr && *value != '\0' && std::strcmp(value, "0") != 0 &&
         std::strcmp(value, "false") != 0;
}

/// The API that eglCreateContext and eglGetCurrentContext speak of is a state of the thread.
class DesktopApi {
 public:
  DesktopApi() : before_(eglQueryAPI()), bound_(eglBindAPI(EGL_OPENGL_API) == EGL_TRUE) {}
  ~DesktopApi() { eglBindAPI(before_); }
  DesktopApi(const DesktopApi&) = delete;
  DesktopApi& operator=(const DesktopApi&) = delete;
  bool bound() const { return bound_; }

 private:
  EGLenum before_;
  bool bound_;
};

}  // namespace

struct GlContext::Current::Before {
  EGLDisplay ours = EGL_NO_DISPLAY;
  EGLDisplay display = EGL_NO_DISPLAY;
  EGLContext context = EGL_NO_CONTEXT;
  EGLSurface draw = EGL_NO_SURFACE;
  EGLSurface read = EGL_NO_SURFACE;
};

GlContext::Current::Current(std::unique_ptr<Before> before) : before_(std::move(before)) {}
GlContext::Current::Current(Current&& other) noexcept = default;
GlContext::Current::~Current() {
  if (before_ == nullptr) return;
  if (before_->context == EGL_NO_CONTEXT ||
      eglMakeCurrent(before_->display, before_->draw, before_->read, before_->context) != EGL_TRUE)
    eglMakeCurrent(before_->ours, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
}

Result<GlContext::Current> GlContext::make_current() const {
  if (context_ == nullptr) return unsupported("OpenGL: the context is gone");
  auto before = std::make_unique<Current::Before>();
  before->ours = display_;
  before->display = eglGetCurrentDisplay();
  before->context = eglGetCurrentContext();
  before->draw = eglGetCurrentSurface(EGL_DRAW);
  before->read = eglGetCurrentSurface(EGL_READ);
  if (eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context_) != EGL_TRUE)
    return unsupported("OpenGL: cannot make the context current: " + egl_error());
  return Current(std::move(before));
}

Status GlContext::check() const {
  if (glGetGraphicsResetStatus() != GL_NO_ERROR)
    return unsupported("OpenGL: the context was lost (" + renderer_ + ")");
  const GLenum error = glGetError();
  if (error == GL_NO_ERROR) return ok();
  // A lost context may go on giving errors: a bound.
  for (int i = 0; i < 16 && glGetError() != GL_NO_ERROR; ++i) {
  }
  return unsupported("OpenGL: error " + std::to_string(error) + " (" + renderer_ + ")");
}

void GlContext::destroy() {
  if (context_ != nullptr) eglDestroyContext(display_, context_);
  context_ = nullptr;
}

GlContext::~GlContext() {
  destroy();
}

Result<std::unique_ptr<GlContext>> GlContext::on_display(void* display, const std::string& name,
                                                         const Options& options) {
  EGLint major = 0;
  EGLint minor = 0;
  if (display == EGL_NO_DISPLAY) return unsupported(name + ": no display: " + egl_error());
  if (eglInitialize(display, &major, &minor) != EGL_TRUE)
    return unsupported(name + ": cannot be initialised: " + egl_error());
  if (!epoxy_has_egl_extension(display, "EGL_KHR_surfaceless_context"))
    return unsupported(name + ": lacks EGL_KHR_surfaceless_context");
  const DesktopApi api;
  if (!api.bound()) return unsupported(name + ": has OpenGL ES only");

  EGLConfig config = nullptr;  // EGL_NO_CONFIG_KHR
  if (!epoxy_has_egl_extension(display, "EGL_KHR_no_config_context")) {
    const EGLint wanted[] = {EGL_SURFACE_TYPE, 0, EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_NONE};
    EGLint count = 0;
    if (eglChooseConfig(display, wanted, &config, 1, &count) != EGL_TRUE || count < 1)
      return unsupported(name + ": no config for OpenGL: " + egl_error());
  }
  std::vector<EGLint> attributes{
      EGL_CONTEXT_MAJOR_VERSION,       options.major,
      EGL_CONTEXT_MINOR_VERSION,       options.minor,
      EGL_CONTEXT_OPENGL_PROFILE_MASK, EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT};
  std::vector<EGLint> telling = attributes;  // when it is lost
  telling.insert(telling.end(), {EGL_CONTEXT_OPENGL_RESET_NOTIFICATION_STRATEGY,
                                 EGL_LOSE_CONTEXT_ON_RESET, EGL_NONE});
  attributes.push_back(EGL_NONE);
  EGLContext made = EGL_NO_CONTEXT;
  if (major > 1 || minor >= 5)
    made = eglCreateContext(display, config, EGL_NO_CONTEXT, telling.data());
  if (made == EGL_NO_CONTEXT)
    made = eglCreateContext(display, config, EGL_NO_CONTEXT, attributes.data());
  if (made == EGL_NO_CONTEXT)
    return unsupported(name + ": no OpenGL " + std::to_string(options.major) + "." +
                       std::to_string(options.minor) + " core context: " + egl_error());
  std::unique_ptr<GlContext> context(new GlContext);
  context->display_ = display;
  context->context_ = made;
  const auto current = context->make_current();
  if (!current) return unsupported(name + ": " + current.error().message);
  const int version = epoxy_gl_version();
  if (version < 10 * options.major + options.minor)
    return unsupported(name + ": OpenGL " + std::to_string(version / 10) + "." +
                       std::to_string(version % 10) + ", not " + std::to_string(options.major) +
                       "." + std::to_string(options.minor));
  const auto* renderer = reinterpret_cast<const char*>(glGetString(GL_RENDERER));
  const std::string who = renderer == nullptr ? "unknown renderer" : renderer;
  context->software_ = runs_on_cpu(who);
  context->renderer_ = who + ", " + name;
  return context;
}

Result<std::unique_ptr<GlContext>> GlContext::create(const Options& options) {
  if (!epoxy_has_egl()) return unsupported("OpenGL: no libEGL on this machine");
  std::string tried;
  std::unique_ptr<GlContext> software;
  const bool first_that_works = software_wanted() && !options.hardware_only;
  // True: search no further.
  const auto offer = [&](void* display, const std::string& name) {
    auto context = on_display(display, name, options);
    if (!context) {
      tried += (tried.empty() ? "" : "; ") + context.error().message;
      return false;
    }
    if ((*context)->is_software())
      tried += (tried.empty() ? "" : "; ") + name + ": only software, " + (*context)->renderer();
    if (software != nullptr && (*context)->is_software()) return false;
    const bool take = first_that_works || !(*context)->is_software();
    software = std::move(*context);
    return take;
  };
  const auto result = [&]() -> Result<std::unique_ptr<GlContext>> {
    if (software != nullptr && !(options.hardware_only && software->is_software()))
      return std::move(software);
    return unsupported("OpenGL: " + (tried.empty() ? "no display to try" : tried));
  };

  const bool surfaceless = epoxy_has_egl_extension(EGL_NO_DISPLAY, "EGL_MESA_platform_surfaceless");
  const bool devices = epoxy_has_egl_extension(EGL_NO_DISPLAY, "EGL_EXT_platform_base") &&
                       epoxy_has_egl_extension(EGL_NO_DISPLAY, "EGL_EXT_platform_device") &&
                       (epoxy_has_egl_extension(EGL_NO_DISPLAY, "EGL_EXT_device_base") ||
                        epoxy_has_egl_extension(EGL_NO_DISPLAY, "EGL_EXT_device_enumeration"));
  if (options.surfaceless) {
    if (!surfaceless) {
      tried = "surfaceless: EGL lacks EGL_MESA_platform_surfaceless";
    } else if (offer(
                   eglGetPlatformDisplayEXT(EGL_PLATFORM_SURFACELESS_MESA,
                                            reinterpret_cast<void*>(EGL_DEFAULT_DISPLAY), nullptr),
                   "surfaceless")) {
      return result();
    }
  }
  if (options.devices) {
    if (!devices) {
      tried +=
          std::string(tried.empty() ? "" : "; ") + "devices: EGL lacks EGL_EXT_platform_device";
      return result();
    }
    constexpr EGLint kMost = 16;
    EGLDeviceEXT found[kMost] = {};
    EGLint count = 0;
    if (eglQueryDevicesEXT(kMost, found, &count) != EGL_TRUE) count = 0;
    if (count == 0) tried += std::string(tried.empty() ? "" : "; ") + "devices: none";
    for (EGLint i = 0; i < count; ++i)
      if (offer(eglGetPlatformDisplayEXT(EGL_PLATFORM_DEVICE_EXT, found[i], nullptr),
                "device " + std::to_string(i)))
        break;
  }
  return result();
}

}  // namespace ivis
