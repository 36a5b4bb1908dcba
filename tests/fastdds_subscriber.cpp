// A subscriber of eProsima Fast DDS, ROS 2's default, that takes samples as the bytes that come: what another
// implementation of DDS sees of ours. Arguments: domain, seconds, then for each topic its name, its type and its
// QoS: reliable, best_effort or latched. Prints "ready", then a line a sample: topic, bytes, CRC-32; at the end a
// line a publication (topic, type, user data) and a line a participant (user data).

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <tuple>
#include <vector>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/subscriber/qos/DataReaderQos.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>

using namespace eprosima::fastdds::dds;
using eprosima::fastrtps::rtps::InstanceHandle_t;
using eprosima::fastrtps::rtps::IPLocator;
using eprosima::fastrtps::rtps::Locator_t;
using eprosima::fastrtps::rtps::ParticipantDiscoveryInfo;
using eprosima::fastrtps::rtps::SerializedPayload_t;
using eprosima::fastrtps::rtps::WriterDiscoveryInfo;

using Bytes = std::vector<unsigned char>;

class AnyType : public TopicDataType
{
public:
    explicit AnyType(const std::string& name)
    {
        setName(name.c_str());
        m_typeSize = 4000000;
        m_isGetKeyDefined = false;
    }

    bool serialize(void*, SerializedPayload_t*) override
    {
        return false;
    }

    bool deserialize(SerializedPayload_t* payload, void* data) override
    {
        static_cast<Bytes*>(data)->assign(payload->data, payload->data + payload->length);
        return true;
    }

    std::function<uint32_t()> getSerializedSizeProvider(void*) override
    {
        return [] { return 0u; };
    }

    void* createData() override
    {
        return new Bytes;
    }

    void deleteData(void* data) override
    {
        delete static_cast<Bytes*>(data);
    }

    bool getKey(void*, InstanceHandle_t*, bool) override
    {
        return false;
    }
};

class Found : public DomainParticipantListener
{
public:
    void on_publisher_discovery(DomainParticipant*, WriterDiscoveryInfo&& info) override
    {
        std::lock_guard<std::mutex> held(lock);
        publications[info.info.topicName().to_string()] = {
            info.info.typeName().to_string(), text(info.info.m_qos.m_userData)};
    }

    void on_participant_discovery(DomainParticipant*, ParticipantDiscoveryInfo&& info) override
    {
        std::lock_guard<std::mutex> held(lock);
        participants.insert(text(info.info.m_userData));
    }

    template<typename Data>
    static std::string text(const Data& data)
    {
        return std::string(data.begin(), data.end());
    }

    std::mutex lock;
    std::map<std::string, std::pair<std::string, std::string>> publications;
    std::set<std::string> participants;
};

static unsigned crc32_of(const Bytes& bytes)
{
    unsigned crc = ~0u;
    for (unsigned char byte : bytes)
    {
        crc ^= byte;
        for (int bit = 0; bit < 8; ++bit)
        {
            crc = crc & 1 ? crc >> 1 ^ 0xEDB88320u : crc >> 1;
        }
    }
    return ~crc;
}

static DomainParticipantQos on_loopback()
{
    DomainParticipantQos qos;
    auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
    udp->interfaceWhiteList.push_back("127.0.0.1");
    udp->receiveBufferSize = udp->sendBufferSize = 4000000;
    qos.transport().use_builtin_transports = false;
    qos.transport().user_transports.push_back(udp);
    Locator_t peer;
    IPLocator::setIPv4(peer, "127.0.0.1");
    qos.wire_protocol().builtin.initialPeersList.push_back(peer);
    return qos;
}

int main(int count, char** given)
{
    Found found;
    auto participant = DomainParticipantFactory::get_instance()->create_participant(
        std::atoi(given[1]), on_loopback(), &found, StatusMask::none());
    if (participant == nullptr)
    {
        return 1;
    }
    auto subscriber = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
    std::vector<DataReader*> readers;
    for (int place = 3; place + 2 < count; place += 3)
    {
        const std::string name = given[place], type_name = given[place + 1], kind = given[place + 2];
        TypeSupport type(new AnyType(type_name));
        type.register_type(participant);
        DataReaderQos qos;
        qos.reliability().kind = kind == "best_effort" ? BEST_EFFORT_RELIABILITY_QOS : RELIABLE_RELIABILITY_QOS;
        qos.durability().kind = kind == "latched" ? TRANSIENT_LOCAL_DURABILITY_QOS : VOLATILE_DURABILITY_QOS;
        qos.history().depth = 20;
        qos.endpoint().history_memory_policy = eprosima::fastrtps::rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
        auto topic = participant->create_topic(name, type_name, TOPIC_QOS_DEFAULT);
        readers.push_back(subscriber->create_datareader(topic, qos));
    }
    std::puts("ready");
    std::fflush(stdout);
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(std::atoi(given[2]));
    while (std::chrono::steady_clock::now() < end)
    {
        for (auto reader : readers)
        {
            Bytes bytes;
            SampleInfo info;
            while (reader->take_next_sample(&bytes, &info) == ReturnCode_t::RETCODE_OK)
            {
                if (info.valid_data)
                {
                    std::printf("sample %s %zu %u\n", reader->get_topicdescription()->get_name().c_str(),
                            bytes.size(), crc32_of(bytes));
                }
            }
        }
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    std::lock_guard<std::mutex> held(found.lock);
    for (const auto& one : found.publications)
    {
        std::printf("publication %s %s %s\n", one.first.c_str(), one.second.first.c_str(),
                one.second.second.c_str());
    }
    for (const auto& one : found.participants)
    {
        std::printf("participant %s\n", one.c_str());
    }
    std::fflush(stdout);
    std::_Exit(0);  // without waiting for the others to notice
}
