#pragma once

#include <string>

#include "core/result.h"

namespace ivis::server {

/// Makes an endpoint free to bind: an ipc path at which nobody listens is removed, as ZeroMQ would
/// take over a live one just as silently as a dead one.
/// Errors: kInvalidArgument for anything but tcp:// and ipc://; kConnection when a live server
/// listens there, or when the path is something other than a socket (which is left alone). Limits:
/// two servers that start within the same instant on one ipc path are not told apart.
Status claim_address(const std::string& endpoint);

/// The endpoint as a person writes it: an IPv4 address that a socket of IPv6 shows as
/// [::ffff:127.0.0.1] is 127.0.0.1, which is also how clients reach it.
std::string plain_endpoint(std::string endpoint);

/// Can only this machine reach it: an ipc path, or a loopback address as a number or 'localhost'?
bool is_local(const std::string& endpoint);

}  // namespace ivis::server
