// SPDX-License-Identifier: GPL-2.0-only
#pragma once

#include <omnetpp.h>

namespace advpipe
{

/// What a station has above its radio: it sends what it is told to, and drops what the radio receives.
class Sender : public omnetpp::cSimpleModule
{
public:
    /// Hand over a packet to the radio at this time.
    void schedule(omnetpp::cPacket*, double powerDbm, const omnetpp::simtime_t&);

protected:
    void handleMessage(omnetpp::cMessage*) override;
};

} // namespace advpipe
