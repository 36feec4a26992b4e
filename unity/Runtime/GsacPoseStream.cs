using System;
using System.Net;
using System.Net.Sockets;
using System.Threading;
using UnityEngine;

namespace Gsac
{
    /// <summary>
    /// Poses and expressions that come live over UDP, a JSON message or an OSC packet each datagram (GsacPoseMessage), smoothed.
    /// Listens to this machine only, unless `Any Address` is on. Whatever is not a message is counted by its fault and left.
    /// </summary>
    [AddComponentMenu("Gsac/Gsac Pose Stream")]
    [DefaultExecutionOrder(8000)]
    [RequireComponent(typeof(GsacAvatar))]
    public sealed class GsacPoseStream : MonoBehaviour
    {
        const int LargestDatagram = 65536;
        const int PatienceUs = 100000;

        [SerializeField] int port = 9000;
        [SerializeField, Tooltip("Listen to other machines too.")] bool anyAddress = false;
        [SerializeField, Tooltip("s: time constant of the smoothing; 0 for none.")] float smoothing = 0.06f;

        readonly object padlock = new object();
        readonly byte[] datagram = new byte[LargestDatagram];
        readonly int[] refused = new int[Enum.GetValues(typeof(GsacMessageFault)).Length];
        GsacAvatar avatar;
        GsacData data;
        GsacPoseMessage message;
        GsacPose incoming;
        float[] incomingWeights;
        Socket socket;
        Thread thread;
        volatile bool listening;
        bool fresh;

        /// <summary>Messages taken, and datagrams that were none.</summary>
        public int Received { get; private set; }
        public int Refused { get; private set; }

        /// <summary>Why the last one was refused; None where all were taken.</summary>
        public GsacMessageFault LastFault { get; private set; }

        public int RefusedFor(GsacMessageFault fault)
        {
            return refused[(int)fault];
        }

        public float Smoothing
        {
            get { return smoothing; }
            set { smoothing = value; }
        }

        public int Port
        {
            get { return port; }
            set { port = value; }
        }

        void OnEnable()
        {
            avatar = GetComponent<GsacAvatar>();
            Prepare();
            socket = new Socket(AddressFamily.InterNetwork, SocketType.Dgram, ProtocolType.Udp);
            try
            {
                socket.Bind(new IPEndPoint(anyAddress ? IPAddress.Any : IPAddress.Loopback, port));
            }
            catch (SocketException e)
            {
                Debug.LogError(name + ": UDP port " + port + " cannot be opened (" + e.Message + "); choose another in Gsac Pose Stream", this);
                socket.Close();
                socket = null;
                return;
            }
            listening = true;
            thread = new Thread(Listen) { IsBackground = true, Name = "Gsac pose stream" };
            thread.Start();
        }

        /// <summary>For the avatar's file as it is now.</summary>
        void Prepare()
        {
            data = avatar.Data;
            message = new GsacPoseMessage(data);
            incoming = new GsacPose(data.JointCount);
            incomingWeights = new float[data.Expressions.Length];
            fresh = false;
        }

        void OnDisable()
        {
            listening = false;
            if (socket == null) return;
            thread.Join();
            socket.Close();
            socket = null;
        }

        void Listen()
        {
            while (listening)
            {
                int length;
                try
                {
                    // a timeout would be an exception, and garbage, several times a second
                    if (!socket.Poll(PatienceUs, SelectMode.SelectRead)) continue;
                    length = socket.Receive(datagram);
                }
                catch (SocketException e)
                {
                    if (e.SocketErrorCode == SocketError.ConnectionReset || e.SocketErrorCode == SocketError.MessageSize) continue;
                    return;
                }
                lock (padlock)
                {
                    GsacMessageFault fault = message.Read(datagram, length, incoming, incomingWeights);
                    if (fault == GsacMessageFault.None)
                    {
                        fresh = true;
                        Received++;
                        continue;
                    }
                    LastFault = fault;
                    Refused++;
                    refused[(int)fault]++;
                }
            }
        }

        void LateUpdate()
        {
            lock (padlock)
            {
                if (!ReferenceEquals(data, avatar.Data)) Prepare();
                if (!fresh) return;
                if (avatar.Source != GsacSource.Script) avatar.Source = GsacSource.Script;
                avatar.Pose.Approach(incoming, Time.deltaTime, smoothing);
                float stay = smoothing > 0 ? Mathf.Exp(-Time.deltaTime / smoothing) : 0;
                float[] weights = avatar.Weights;
                for (int e = 0; e < weights.Length; e++) weights[e] = incomingWeights[e] + (weights[e] - incomingWeights[e]) * stay;
            }
        }
    }
}
