// SPDX-License-Identifier: GPL-2.0-only
#pragma once

#include "Link.h"

#include <functional>
#include <inet/physicallayer/contract/packetlevel/IReception.h>
#include <map>
#include <omnetpp.h>

namespace advpipe
{

/// The GeoNetworking packet in a frame of the link layer; null for any other frame.
const omnetpp::cPacket* packetIn(omnetpp::cObject* frame);

std::uint64_t ns(const omnetpp::simtime_t&);

double db(double ratio);

/// Tells advpipe which packets the stations' radios decode, and the channel loads that they measure.
class Radios : public omnetpp::cListener
{
public:
    /// number: what advpipe calls a packet
    Radios(Link& link, std::function<std::uint64_t(const omnetpp::cPacket&)> number);

    void listen();
    void add(const omnetpp::cModule& host, std::uint32_t station);
    void remove(const omnetpp::cModule& host);

    /// the id of the station that a module belongs to, -1 for one outside of stations
    std::int64_t station(const omnetpp::cComponent* inside) const;

    void receiveSignal(omnetpp::cComponent*, omnetpp::simsignal_t, double, omnetpp::cObject*) override;
    void receiveSignal(omnetpp::cComponent*, omnetpp::simsignal_t, omnetpp::cObject*, omnetpp::cObject*) override;

private:
    struct Success {
        const omnetpp::cComponent* radio;
        std::uint64_t packet;
        double snir;
    };

    void ended(const inet::physicallayer::IReception&);

    Link& mLink;
    std::function<std::uint64_t(const omnetpp::cPacket&)> mNumber;
    std::map<int, std::uint32_t> mStations; ///< ids by the id of the station's module
    Success mSuccess { nullptr, 0, 0.0 }; ///< the newest frame that a radio has decoded
};

} // namespace advpipe
