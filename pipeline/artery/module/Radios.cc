// SPDX-License-Identifier: GPL-2.0-only
#include "Radios.h"

#include <artery/networking/GeoNetPacket.h>
#include <artery/nic/RadioDriverBase.h>
#include <cmath>
#include <inet/common/LayeredProtocolBase.h>
#include <inet/common/ModuleAccess.h>
#include <inet/linklayer/ieee80211/mac/Rx.h>
#include <inet/physicallayer/analogmodel/packetlevel/ScalarReception.h>
#include <inet/physicallayer/common/packetlevel/Radio.h>
#include <inet/physicallayer/contract/packetlevel/IRadioMedium.h>
#include <inet/physicallayer/contract/packetlevel/RadioControlInfo_m.h>

using namespace omnetpp;
using artery::RadioDriverBase;
using inet::LayeredProtocolBase;
using inet::physicallayer::IRadioMedium;

namespace advpipe
{

const cPacket* packetIn(cObject* frame)
{
    auto packet = dynamic_cast<cPacket*>(frame);
    return packet ? dynamic_cast<const artery::GeoNetPacket*>(packet->getEncapsulatedPacket()) : nullptr;
}

std::uint64_t ns(const simtime_t& time)
{
    return static_cast<std::uint64_t>(time.inUnit(SIMTIME_NS));
}

double db(double ratio)
{
    return 10.0 * std::log10(ratio);
}

Radios::Radios(Link& link, std::function<std::uint64_t(const cPacket&)> number) : mLink(link), mNumber(number)
{
}

void Radios::listen()
{
    for (auto signal : { RadioDriverBase::ChannelLoadSignal, LayeredProtocolBase::packetSentToUpperSignal,
             IRadioMedium::receptionEndedSignal }) {
        getSimulation()->getSystemModule()->subscribe(signal, this);
    }
}

void Radios::add(const cModule& host, std::uint32_t station)
{
    mStations[host.getId()] = station;
}

void Radios::remove(const cModule& host)
{
    mStations.erase(host.getId());
}

std::int64_t Radios::station(const cComponent* inside) const
{
    auto module = dynamic_cast<const cModule*>(inside);
    auto host = module ? inet::findContainingNode(module) : nullptr;
    auto found = host ? mStations.find(host->getId()) : mStations.end();
    return found == mStations.end() ? -1 : static_cast<std::int64_t>(found->second);
}

void Radios::receiveSignal(cComponent* source, simsignal_t, double value, cObject*)
{
    const auto id = station(source);
    if (id >= 0 && dynamic_cast<inet::ieee80211::Rx*>(source)) {
        mLink.write(Record('L').number(ns(simTime()), 8).number(id, 4).real(value));
    }
}

void Radios::receiveSignal(cComponent* source, simsignal_t signal, cObject* object, cObject*)
{
    if (signal == LayeredProtocolBase::packetSentToUpperSignal) {
        auto frame = dynamic_cast<cPacket*>(object);
        auto packet = packetIn(object);
        if (packet && !frame->hasBitError() && dynamic_cast<inet::physicallayer::Radio*>(source)) {
            auto seen = dynamic_cast<inet::physicallayer::ReceptionIndication*>(frame->getControlInfo());
            mSuccess = { source, mNumber(*packet), seen ? seen->getMinSNIR() : NaN };
        }
    } else if (signal == IRadioMedium::receptionEndedSignal) {
        ended(*check_and_cast<inet::physicallayer::IReception*>(object));
    }
}

/// A radio emits this right after it has handed up the frame, if it could decode it.
void Radios::ended(const inet::physicallayer::IReception& reception)
{
    auto radio = dynamic_cast<const cComponent*>(reception.getReceiver());
    if (!radio || mSuccess.radio != radio) {
        return;
    }
    const auto id = station(radio);
    auto signal = dynamic_cast<const inet::physicallayer::IScalarSignal*>(reception.getAnalogModel());
    if (id >= 0) {
        mLink.write(Record('R').number(ns(simTime()), 8).number(id, 4).number(mSuccess.packet, 8)
                .real(signal ? db(1000.0 * signal->getPower().get()) : NaN).real(db(mSuccess.snir)));
    }
    mSuccess.radio = nullptr;
}

} // namespace advpipe
