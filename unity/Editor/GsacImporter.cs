using System.IO;
using UnityEditor.AssetImporters;
using UnityEngine;

namespace Gsac
{
    /// <summary>A .gsac file in the project becomes a prefab: skeleton, Humanoid Avatar, mesh, clips, components.</summary>
    [ScriptedImporter(3, "gsac")]
    public sealed class GsacImporter : ScriptedImporter
    {
        public override void OnImportAsset(AssetImportContext context)
        {
            byte[] bytes;
            GsacData data;
            try
            {
                bytes = GsacData.Load(context.assetPath);
                data = GsacData.Read(bytes).Mirror();
            }
            catch (GsacException e)
            {
                context.LogImportError(context.assetPath + ": " + e.Message);
                return;
            }
            var asset = ScriptableObject.CreateInstance<GsacAsset>();
            asset.name = "Data";
            asset.Bytes = bytes;

            var root = new GameObject(Path.GetFileNameWithoutExtension(context.assetPath));
            Transform[] joints = GsacSkeleton.Build(data, root.transform);
            Avatar humanoid = GsacHumanoid.Build(data, root.name);
            Mesh mesh = GsacMesh.Build(data);
            GsacMesh.Attach(mesh, new GsacExtent(data), root.transform, joints);
            bool human = humanoid.isValid && humanoid.isHuman;
            if (!human)
            {
                context.LogImportWarning(context.assetPath + ": Unity takes the skeleton not as Humanoid; scripted poses work, Humanoid clips do not");
            }
            var animator = root.AddComponent<Animator>();
            animator.avatar = humanoid;
            // GsacAvatar brings its GsacRenderer
            root.AddComponent<GsacAvatar>().Use(asset);

            context.AddObjectToAsset("prefab", root, GsacThumbnail.Paint(data));
            context.AddObjectToAsset("data", asset);
            context.AddObjectToAsset("mesh", mesh);
            context.AddObjectToAsset("humanoid", humanoid);
            foreach (GsacClip clip in data.Clips.Values)
            {
                if (!human) break;
                AnimationClip made = GsacHumanClip.Build(data, clip, humanoid, root.transform, joints);
                context.AddObjectToAsset("clip " + clip.Name, made);
            }
            context.SetMainObject(root);
        }
    }
}
